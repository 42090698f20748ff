// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The past of one vehicle for plots: a list of each column over time. */

import { VEHICLE, VEHICLE_WIDTH } from './frames.js';

/**
 * Arrays of the same length: t [s] and each column of VEHICLE.
 *
 * @typedef {Record<keyof typeof VEHICLE|'t', number[]>} History
 */

const COLUMNS = /** @type {[keyof typeof VEHICLE, number][]} */ (Object.entries(VEHICLE));

/** @returns {History} without a sample */
export function emptyHistory() {
  const columns = COLUMNS.map(([name]) => [name, []]);
  return /** @type {History} */ (Object.fromEntries([['t', []], ...columns]));
}

/**
 * Add a vehicle's values of a sample.
 *
 * @param {History} past to which they are appended
 * @param {{t: number, vehicles: Float64Array}} sample rows of all vehicles
 * @param {number} index of the vehicle
 */
export function addToHistory(past, { t, vehicles }, index) {
  past.t.push(t);
  for (const [name, column] of COLUMNS) {
    past[name].push(vehicles[index * VEHICLE_WIDTH + column]);
  }
}
