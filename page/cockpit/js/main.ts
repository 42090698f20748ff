// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Entry point of the page: one store, one connection, the world, and the parts around it. */

import { Connection } from './connection.js';
import { errorText } from './panels/format.js';
import { addPanels } from './panels/tabs.js';
import { PARTS, STAGE } from './parts.js';
import { readStage } from './stage/stage_address.js';
import { Store } from './store.js';
import { driverSight } from './world/driver_sight.js';
import { World } from './world/world.js';

const bare = readStage(window.location.search) !== null;
document.documentElement.classList.toggle('bare', bare);
const parts = bare ? [['./stage/stage.js', 'createStage', '#stage', 'stage'],
  ...PARTS.filter(([, , , name]) => STAGE.includes(name))] : PARTS;
addPanels(document.querySelector('#panels') as HTMLElement);
const store = new Store();
const connection = new Connection(store);
const world = new World(
  document.querySelector('#world') as HTMLCanvasElement, store,
  { connection, covered: document.querySelector('#hud'), keys: !bare, toolbar: !bare,
    sight: () => driverSight(store) });
window.crgame = { store, connection, world };

// All are fetched at once, but begin in their order.
const modules = parts.map(([path]) => import(path));
for (const module of modules) {
  // Told below, when it is its turn.
  module.catch(() => {});
}
for (const [i, [path, make, root, name]] of parts.entries()) {
  try {
    const module = await modules[i];
    // A class, or a function, whose object `new` returns as well.
    window.crgame[name] = new module[make](document.querySelector(root), store, connection);
  } catch (error) {
    console.error(`${path}: ${error}`);
    store.receive({ type: 'notice', level: 'error', text: `${path} failed: ${errorText(error)}` });
  }
}
await window.crgame.stage?.begin();
// All parts have been loaded.
window.crgame.ready = true;
