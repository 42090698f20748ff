// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Mishaps that a driver is told of at once: contacts, and departures from the road. */

import { clockTime, oneLine } from './format.js';

/** @import { Store } from '../store.js' */

/** @typedef {{t: number, touched: boolean, text: string}} Mishap */

/**
 * Return the contacts and road departures of a vehicle, in the order of time.
 *
 * @param {Store} store
 * @param {string} mine the vehicle
 * @returns {Mishap[]}
 */
export function mishapsOf({ status }, mine) {
  const { contacts = [], departures = [] } = status ?? {};
  /** @type {(t: number, other: string) => Mishap} */
  const touched = (t, other) => ({
    t, touched: true, text: `You touched ${oneLine(other)} at ${clockTime(t)}.` });
  return [
    ...contacts.filter((item) => item.vehicle === mine || item.with === mine).map(
      (item) => touched(item.t, item.vehicle === mine ? item.with : item.vehicle)),
    ...departures.filter(({ vehicle }) => vehicle === mine).map(({ t }) => ({
      t, touched: false, text: `You left the road at ${clockTime(t)}.` })),
  ].sort((a, b) => a.t - b.t);
}
