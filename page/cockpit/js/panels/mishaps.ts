// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Mishaps that a driver is told of at once: contacts, and departures from the road. */

import { clockTime, oneLine } from './format.js';

import type { Store } from '../store.js';

export interface Mishap { t: number; touched: boolean; text: string }

/**
 * Return the contacts and road departures of a vehicle, in the order of time.
 * @param mine the vehicle
 */
export function mishapsOf({ status }: Store, mine: string): Mishap[] {
  const { contacts = [], departures = [] } = status ?? {};
  const touched = (t: number, other: string): Mishap => ({
    t, touched: true, text: `You touched ${oneLine(other)} at ${clockTime(t)}.` });
  return [
    ...contacts.filter((item) => item.vehicle === mine || item.with === mine).map(
      (item) => touched(item.t, item.vehicle === mine ? item.with : item.vehicle)),
    ...departures.filter(({ vehicle }) => vehicle === mine).map(({ t }) => ({
      t, touched: false, text: `You left the road at ${clockTime(t)}.` })),
  ].sort((a, b) => a.t - b.t);
}
