// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** What scripts of the page share on `window`, and what TypeScript's library does not know yet. */

import type { Connection } from '../../crgame_ros/cockpit/page/js/connection.js';
import type { Driving } from '../../crgame_ros/cockpit/page/js/driving/driving.js';
import type { createPerson } from '../../crgame_ros/cockpit/page/js/person.js';
import type { createInstantReplay } from
  '../../crgame_ros/cockpit/page/js/after/instant_replay.js';
import type { createScenario } from '../../crgame_ros/cockpit/page/js/panels/scenario.js';
import type { Plotly } from '../../crgame_ros/cockpit/page/js/panels/plotly.js';
import type { createPerception } from
  '../../crgame_ros/cockpit/page/js/perception/perception.js';
import type { Sound } from '../../crgame_ros/cockpit/page/js/sound/sound.js';
import type { Stage } from '../../crgame_ros/cockpit/page/js/stage/stage.js';
import type { Store } from '../../crgame_ros/cockpit/page/js/store.js';
import type { View3d } from '../../crgame_ros/cockpit/page/js/view3d/view3d.js';
import type { World } from '../../crgame_ros/cockpit/page/js/world/world.js';

/** main.js fills it: every part may be missing, because each is loaded by itself. */
interface Crgame {
  store: Store;
  connection: Connection;
  world: World;
  driving?: Driving;
  person?: ReturnType<typeof createPerson>;
  perception?: ReturnType<typeof createPerception>;
  sound?: Sound;
  view3d?: View3d;
  lastSeconds?: ReturnType<typeof createInstantReplay>;
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
