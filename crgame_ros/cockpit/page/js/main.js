// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Entry point of the page: one store, one connection, the world, and the parts around it. */

import { Connection } from './connection.js';
import { readStage } from './stage/stage_address.js';
import { Store } from './store.js';
import { driverSight } from './world/driver_sight.js';
import { createWorld } from './world/world.js';

// [module, its create function, selector of its root, name in window.crgame]. They are loaded one
// by one, so that a part that cannot be loaded is named on the page and the others still work.
const PARTS = [
  ['./panels/notices.js', 'createNotices', '#notices', 'notices'],
  ['./person.js', 'createPerson', 'body', 'person'],
  ['./driving/driving.js', 'createDriving', '#hud', 'driving'],
  ['./tasks/tasks.js', 'createTasks', '#stage', 'tasks'],
  ['./lobby.js', 'createLobby', '#stage', 'lobby'],
  ['./people.js', 'createPeople', '#panel-drive', 'people'],
  ['./run_control.js', 'createRunControl', '#bar', 'runControl'],
  ['./panels/settings.js', 'createSettings', '#bar-end', 'settings'],
  ['./sound/sound.js', 'createSound', '#bar-end', 'sound'],
  ['./panels/title.js', 'createTitle', '#title', 'title'],
  ['./panels/alarms.js', 'createAlarms', '#alarms', 'alarms'],
  ['./panels/tabs.js', 'createTabs', '#panels', 'panels'],
  ['./panels/scenario.js', 'createScenario', '#panel-scenario', 'scenario'],
  ['./panels/events.js', 'createEvents', '#panel-events', 'events'],
  ['./tasks/task_panel.js', 'createTaskPanel', '#panel-events', 'taskPanel'],
  ['./panels/planners.js', 'createPlanners', '#planners', 'planners'],
  ['./panels/timing.js', 'createTiming', '#timekeeping', 'timing'],
  ['./after/instant_replay.js', 'createInstantReplay', '#last-seconds', 'lastSeconds'],
  ['./after/restart_key.js', 'createRestart', '#stage', 'restart'],
  ['./after/run_list.js', 'createRunList', '#panel-runs', 'runs'],
  ['./panels/outcome.js', 'createOutcome', '#outcome', 'outcome'],
  ['./panels/history.js', 'createHistory', '#panel-history', 'history'],
  ['./panels/criticality_panel.js', 'createCriticality', '#panel-criticality', 'criticality'],
  ['./perception/perception.js', 'createPerception', '#stage', 'perception'],
  ['./view3d/view3d.js', 'createView3d', '#stage', 'view3d'],
  ['./view_report.js', 'createViewReport', '#stage', 'viewReport'],
  ['./world/around.js', 'createAround', '#around', 'around'],
  ['./panels/save_panel.js', 'createSaving', '#panels', 'saving'],
  ['./replay/player.js', 'createReplay', '#timeline', 'replay'],
];
// Parts of a stage, for a person that only drives; names of missing parts are ignored.
const STAGE = ['person', 'driving', 'tasks', 'lobby', 'sound', 'view3d', 'viewReport'];

const bare = readStage(window.location.search) !== null;
document.documentElement.classList.toggle('bare', bare);
const parts = bare ? [['./stage/stage.js', 'createStage', '#stage', 'stage'],
  ...PARTS.filter(([, , , name]) => STAGE.includes(name))] : PARTS;
const store = new Store();
const connection = new Connection(store);
const world = createWorld(
  /** @type {HTMLCanvasElement} */ (document.querySelector('#world')), store,
  { connection, covered: document.querySelector('#hud'), keys: !bare, toolbar: !bare,
    sight: () => driverSight(store) });
window.crgame = { store, connection, world };

for (const [path, create, root, name] of parts) {
  try {
    const module = await import(path);
    window.crgame[name] = module[create](document.querySelector(root), store, connection);
  } catch (error) {
    console.error(`${path}: ${error}`);
    const text = `${path} failed: ${error instanceof Error ? error.message : error}`;
    store.receive({ type: 'notice', level: 'error', text });
  }
}
await window.crgame.stage?.begin();
// All parts have been loaded.
window.crgame.ready = true;
