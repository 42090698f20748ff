// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** What scripts of the page share on `window`, and what TypeScript's library does not know yet. */

import type { Connection } from '../../page/cockpit/js/connection.js';
import type { Driving } from '../../page/cockpit/js/driving/driving.js';
import type { Person } from '../../page/cockpit/js/person.js';
import type { InstantReplay } from '../../page/cockpit/js/after/instant_replay.js';
import type { createScenario } from '../../page/cockpit/js/panels/scenario.js';
import type { Plotly } from '../../page/cockpit/js/panels/plotly.js';
import type { Perception } from '../../page/cockpit/js/perception/perception.js';
import type { Sound } from '../../page/cockpit/js/sound/sound.js';
import type { Stage } from '../../page/cockpit/js/stage/stage.js';
import type { Store } from '../../page/cockpit/js/store.js';
import type { Tasks } from '../../page/cockpit/js/tasks/tasks.js';
import type { View3d } from '../../page/cockpit/js/view3d/view3d.js';
import type { World } from '../../page/cockpit/js/world/world.js';

/** main.js fills it: every part may be missing, because each is loaded by itself. */
interface Crgame {
  store: Store;
  connection: Connection;
  world: World;
  driving?: Driving;
  person?: Person;
  perception?: Perception;
  sound?: Sound;
  tasks?: Tasks;
  view3d?: View3d;
  lastSeconds?: InstantReplay;
  stage?: Stage;
  scenario?: ReturnType<typeof createScenario>;
  ready?: boolean;
  [part: string]: unknown;
}

declare global {
  interface Window {
    crgame: Crgame;
    Plotly: Plotly;
  }

  interface Navigator {
    /** Chromium's, https://wicg.github.io/keyboard-map/ */
    keyboard?: { getLayoutMap?: () => Promise<ReadonlyMap<string, string>> };
  }
}
