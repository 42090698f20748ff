// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Whether the person at this page is the driver of a seat, or rides in it. */

import type { Store } from './store.js';

/** Return whether the person at this page drives a vehicle, or rides in an AV. */
export function attends(store: Store, seat: string): boolean {
  return store.mode === 'live' && store.me.id !== '' && (store.holds(seat) || rides(store, seat));
}

/** Return whether the person rides in an AV that its planner drives. */
function rides(store: Store, seat: string) {
  const { seats, rights } = store;
  const own = window.crgame.stage?.address.seat ?? rights.seat;
  return own === seat && rights.drives && seats[seat] !== undefined && !seats[seat].holder
    && store.vehicle(seat)?.role === 'autonomous';
}
