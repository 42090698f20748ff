// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** What the page consists of: its panels, and the parts that fill them and the stage. */

/**
 * The panels at the right, in the order of their tabs. A panel needs an entry here, and one or
 * more parts in `#panel-<name>`. `saves` tells what can be saved: the plots of the part of that
 * name, and all tables.
 */
export const PANELS: { name: string; label: string; saves?: ('plots' | 'tables')[] }[] = [
  { name: 'drive', label: 'Drive' },
  { name: 'history', label: 'History', saves: ['plots'] },
  { name: 'scenario', label: 'Scenario' },
  { name: 'events', label: 'Events' },
  { name: 'criticality', label: 'Criticality', saves: ['plots', 'tables'] },
  { name: 'timing', label: 'Timing', saves: ['tables'] },
  { name: 'runs', label: 'Runs' },
];

// [module, its class or function, selector of its root, name in window.crgame]. They begin one by
// one, so that a part that cannot be loaded is named on the page and the others still work.
export const PARTS = [
  ['./panels/notices.js', 'createNotices', '#notices', 'notices'],
  ['./person.js', 'Person', 'body', 'person'],
  ['./driving/driving.js', 'createDriving', '#hud', 'driving'],
  ['./tasks/tasks.js', 'Tasks', '#stage', 'tasks'],
  ['./lobby.js', 'Lobby', '#stage', 'lobby'],
  ['./people.js', 'People', '#panel-drive', 'people'],
  ['./run_control.js', 'RunControl', '#bar', 'runControl'],
  ['./panels/settings.js', 'createSettings', '#bar-end', 'settings'],
  ['./sound/sound.js', 'Sound', '#bar-end', 'sound'],
  ['./panels/title.js', 'createTitle', '#title', 'title'],
  ['./panels/alarms.js', 'createAlarms', '#alarms', 'alarms'],
  ['./panels/tabs.js', 'createTabs', '#panels', 'panels'],
  ['./panels/scenario.js', 'createScenario', '#panel-scenario', 'scenario'],
  ['./panels/events.js', 'createEvents', '#panel-events', 'events'],
  ['./tasks/task_panel.js', 'createTaskPanel', '#panel-events', 'taskPanel'],
  ['./panels/planners.js', 'createPlanners', '#panel-timing', 'planners'],
  ['./panels/timing.js', 'createTiming', '#panel-timing', 'timing'],
  ['./after/instant_replay.js', 'InstantReplay', '#last-seconds', 'lastSeconds'],
  ['./after/restart_key.js', 'createRestart', '#stage', 'restart'],
  ['./after/run_list.js', 'RunList', '#panel-runs', 'runs'],
  ['./panels/outcome.js', 'Outcome', '#outcome', 'outcome'],
  ['./panels/history.js', 'createHistory', '#panel-history', 'history'],
  ['./panels/criticality_panel.js', 'createCriticality', '#panel-criticality', 'criticality'],
  ['./perception/perception.js', 'Perception', '#stage', 'perception'],
  ['./view3d/view3d.js', 'View3d', '#stage', 'view3d'],
  ['./view_report.js', 'ViewReport', '#stage', 'viewReport'],
  ['./world/around.js', 'createAround', '#around', 'around'],
  ['./panels/save_panel.js', 'createSaving', '#panels', 'saving'],
  ['./replay/player.js', 'Player', '#timeline', 'replay'],
];
// Parts of a stage, for a person that only drives; names of missing parts are ignored.
export const STAGE = ['person', 'driving', 'tasks', 'lobby', 'sound', 'view3d', 'viewReport'];
