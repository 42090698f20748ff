// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * What a stage and the page that it lies in say to each other by postMessage, as types: nothing
 * here runs. docs/stage.md is for those who write such a page.
 */

export {};

/** @import { RunState } from '../messages.js' */
/** @import { Viewpoint } from '../view3d/cameras.js' */

/** @typedef {Viewpoint|'map'} StageView */

/**
 * What the stage tells.
 *
 * @typedef {object} StageState
 * @property {string} seat that the address names
 * @property {boolean} seated whether this page has it
 * @property {boolean} rides whether it is that of an AV which its planner drives
 * @property {boolean} connected to the simulation
 * @property {RunState|null} run null before the first word of it
 * @property {string} reason why the run ended; empty before
 * @property {number} epoch counts resets; -1 before the first state
 * @property {number|null} time_s the run's clock, of the picture that is shown
 * @property {boolean} ready whether the simulation has the driver down as ready
 * @property {number} countdown_s until the run begins; 0 for none
 * @property {StageView} view what is shown
 * @property {boolean} missing3d whether the map is shown because there is no 3D view to be had
 * @property {'on'|'waits'|'off'|'none'} sound `waits` for a key, a click or a gamepad's button;
 *   `none` in the game
 * @property {boolean} hasInput whether the hands are on the controls
 * @property {string} away why they are not: focus, hidden, dialog, connection, unplugged
 * @property {string} device what the hands are on
 * @property {number|null} delay_ms of the way to the server and back
 * @property {number|null} input_delay_ms from the hand to the answer, at the page
 * @property {string} trouble what keeps the driver from driving, in English; empty for nothing
 */

/**
 * @typedef {{crgame: 1, kind: 'stage', state: StageState}} StageTells to the page around it
 * @typedef {{crgame: 1, kind: 'ready', ready: boolean}} ReadyOrder from it
 * @typedef {{crgame: 1, kind: 'focus'}} FocusOrder from it
 * @typedef {{crgame: 1, kind: 'calibrations', profiles: Record<string, string>}
 *   } CalibrationsOrder from it: JSON of mappings of gamepads and wheels, by the device's name
 * @typedef {ReadyOrder|FocusOrder|CalibrationsOrder} StageOrder
 */
