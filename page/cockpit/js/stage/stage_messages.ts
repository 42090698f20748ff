// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * Types of the postMessage messages between a stage and its framing page: no code here.
 * docs/stage.md describes them for authors of such a page.
 */

export {};

/** @import { RunState } from '../messages.js' */
/** @import { Viewpoint } from '../view3d/cameras.js' */

/** @typedef {Viewpoint|'map'} StageView */

/**
 * The state that the stage reports.
 *
 * @typedef {object} StageState
 * @property {string} seat in the address
 * @property {boolean} seated whether this page holds it
 * @property {boolean} rides whether the vehicle is an AV that its planner drives
 * @property {boolean} connected to the simulation
 * @property {RunState|null} run null before the first report
 * @property {string} reason why the run ended; empty before
 * @property {number} epoch counts resets; -1 before the first state
 * @property {number|null} time_s the run's clock, of the picture that is shown
 * @property {boolean} ready whether the simulation counts the driver as ready
 * @property {number} countdown_s until the run begins; 0 for none
 * @property {StageView} view what is shown
 * @property {boolean} missing3d whether the map is shown because the 3D view is not available
 * @property {'on'|'waits'|'off'|'none'} sound `waits` for a key, a click or a gamepad's button;
 *   `none` in the game
 * @property {boolean} hasInput whether the driver's inputs act on the vehicle
 * @property {string} away why they do not: focus, hidden, dialog, connection, unplugged
 * @property {string} device the input device
 * @property {number|null} delay_ms round-trip time to the server
 * @property {number|null} input_delay_ms from an input to the visible answer, at the page
 * @property {string} trouble why the driver cannot drive, in English; empty for no trouble
 */

/**
 * @typedef {{crgame: 1, kind: 'stage', state: StageState}} StageTells to the framing page
 * @typedef {{crgame: 1, kind: 'ready', ready: boolean}} ReadyOrder from it
 * @typedef {{crgame: 1, kind: 'focus'}} FocusOrder from it
 * @typedef {{crgame: 1, kind: 'calibrations', profiles: Record<string, string>}
 *   } CalibrationsOrder from it: JSON of mappings of gamepads and wheels, by the device's name
 * @typedef {ReadyOrder|FocusOrder|CalibrationsOrder} StageOrder
 */
