// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Texts that say what drives a seat. */

import { oneLine } from '../panels/format.js';

import type { Seat } from '../messages.js';

const GAME_DRIVERS = new Map<string, (rest: string) => string>([
  ['auto', () => 'Driven by a device on the simulation machine, if one is there'],
  ['evdev', (name) => (name ? `Driven by the device ${name}` : 'Driven by a device')],
  ['idle', () => 'Not driven'],
  ['joy', (file) => (file ? `Driven by the script ${file}` : 'Driven by a ROS joy node')],
  ['keys', (file) => `Driven by the script ${file}`],
  ['policy', (file) => `Driven by the policy ${file}`],
  ['replay', (bag) => `Replays the recording ${bag}`],
]);

/**
 * Return a text that says what drives a seat.
 * @param role 'human' or 'autonomous'
 * @param planner name of the AV's planner
 * @param me id of this client
 */
export function describeSeat(
  seat: Pick<Seat, 'source' | 'driver' | 'holder' | 'holder_name' | 'kept'>,
  role: string | undefined, planner: string | undefined, me: string): string {
  if (seat.holder !== null) {
    return seat.holder === me && me !== '' ? 'You drive'
      : `Driven by ${oneLine(seat.holder_name || seat.holder)} in a cockpit`;
  }
  if (seat.source === 'cockpit' && seat.kept) {
    return `Kept for ${oneLine(seat.kept.name) || 'its driver'} for ${seat.kept.for_s} s`;
  }
  if (seat.source === 'cockpit') {
    return seat.driver === 'cockpit' ? 'Waits for a driver in a cockpit'
      : 'Left by its driver in a cockpit';
  }
  if (seat.source === 'replay') {
    return 'Driven as in the recording';
  }
  if (seat.source !== 'game' && seat.source !== 'planner') {
    return `Driven by the source ${seat.source}`;
  }
  if (role === 'autonomous') {
    return planner ? `Driven by the planner ${planner}` : 'Driven by its planner';
  }
  const [kind, ...rest] = (seat.driver ?? '').split(':');
  return GAME_DRIVERS.get(kind)?.(rest.join(':')) ?? 'Driven as the game says';
}
