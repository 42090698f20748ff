// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * Types of the postMessage messages between a stage and its framing page: no code here.
 * docs/stage.md describes them for authors of such a page.
 */

import type { RunState } from '../messages.js';
import type { Viewpoint } from '../view3d/cameras.js';

export type StageView = Viewpoint | 'map';

/** The state that the stage reports. */
export interface StageState {
  seat: string; // in the address
  seated: boolean; // whether this page holds it
  rides: boolean; // whether the vehicle is an AV that its planner drives
  connected: boolean; // to the simulation
  run: RunState | null; // null before the first report
  reason: string; // why the run ended; empty before
  epoch: number; // counts resets; -1 before the first state
  time_s: number | null; // the run's clock, of the picture that is shown
  ready: boolean; // whether the simulation counts the driver as ready
  countdown_s: number; // until the run begins; 0 for none
  view: StageView; // what is shown
  drawn: boolean; // whether this view has drawn a picture of the present run
  missing3d: boolean; // whether the map is shown because the 3D view is not available
  // `waits` for a key, a click or a gamepad's button; `none` in the game
  sound: 'on' | 'waits' | 'off' | 'none';
  hasInput: boolean; // whether the driver's inputs act on the vehicle
  away: string; // why they do not: focus, hidden, dialog, connection, unplugged
  device: string; // the input device
  delay_ms: number | null; // round-trip time to the server
  input_delay_ms: number | null; // from an input to the visible answer, at the page
  trouble: string; // why the driver cannot drive, in English; empty for no trouble
}

export interface ReadyOrder { crgame: 1; kind: 'ready'; ready: boolean } // from it
export interface FocusOrder { crgame: 1; kind: 'focus' } // from it

/** From it: JSON of mappings of gamepads and wheels, by the device's name. */
export interface CalibrationsOrder {
  crgame: 1;
  kind: 'calibrations';
  profiles: Record<string, string>;
}

export type StageOrder = ReadyOrder | FocusOrder | CalibrationsOrder;
