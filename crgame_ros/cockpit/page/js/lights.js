// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Indicators and horn of a vehicle, as encoded in the column `lights` of its state. */

/** Bits of the column; both indicators together are the hazard lights. */
export const LIGHT = Object.freeze({ left: 1, right: 2, horn: 4 });

/** The buttons of an input message's `lights`, in its order. */
export const LIGHT_BUTTONS = /** @type {const} */ ([
  'left_indicator', 'right_indicator', 'hazard', 'horn',
]);

const BLINKS_PER_S = 1.5;

/**
 * Return the lights that are lit at a time: active indicators blink in simulation time.
 *
 * @param {number|undefined} lights the column; undefined means none
 * @param {number} t simulation time [s]
 * @returns {{left: boolean, right: boolean, horn: boolean}}
 */
export function shining(lights, t) {
  const bits = Number.isFinite(lights) ? Number(lights) : 0;
  const lit = (t * BLINKS_PER_S) % 1 < 0.5;
  return {
    left: lit && (bits & LIGHT.left) > 0, right: lit && (bits & LIGHT.right) > 0,
    horn: (bits & LIGHT.horn) > 0,
  };
}
