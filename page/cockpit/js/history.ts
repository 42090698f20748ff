// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The past of one vehicle for plots: a list of each column over time. */

import { VEHICLE, VEHICLE_WIDTH } from './frames.js';

/** Arrays of the same length: t [s] and each column of VEHICLE. */
export type History = Record<keyof typeof VEHICLE | 't', number[]>;

const COLUMNS = Object.entries(VEHICLE) as [keyof typeof VEHICLE, number][];

/** @returns without a sample */
export function emptyHistory(): History {
  const columns = COLUMNS.map(([name]) => [name, []]);
  return Object.fromEntries([['t', []], ...columns]) as History;
}

/**
 * Add a vehicle's values of a sample.
 * @param past to which they are appended
 * @param sample rows of all vehicles
 * @param index of the vehicle
 */
export function addToHistory(past: History, { t, vehicles }: { t: number; vehicles: Float64Array },
  index: number) {
  past.t.push(t);
  for (const [name, column] of COLUMNS) {
    past[name].push(vehicles[index * VEHICLE_WIDTH + column]);
  }
}
