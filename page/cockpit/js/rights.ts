// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Reasons, in words, why a person may not use a control of this page. */

import type { RunAction } from './messages.js';
import type { Store } from './store.js';

/**
 * Return why an action is not allowed here; the server checks it too.
 *
 * @param right that it needs
 * @param deed as in 'reset the run'
 * @returns empty if it may be done
 */
export function reasonAgainst(store: Store, right: 'direct' | 'drive', deed: string): string {
  const { directs, drives, role } = store.rights;
  if (store.mode === 'replay' || role === '' || (right === 'direct' ? directs : drives)) {
    return '';
  }
  return `Only a ${right === 'direct' ? 'director' : 'driver'} can ${deed}; you are a ${role}.`;
}

/**
 * Return why an order is not allowed; a driver in the seat uses start to report ready.
 *
 * @returns empty if it can
 */
export function reasonAgainstOrder(store: Store, action: RunAction): string {
  const { seats, me, status, rights } = store;
  const seated = Object.values(seats).some(({ holder }) => holder === me.id && me.id !== '');
  if (action === 'start' && seated && status?.n === 0 && rights.drives) {
    return '';
  }
  return reasonAgainst(store, 'direct', `${action} the run`);
}

/**
 * Return why this person cannot act on a seat.
 *
 * @param id of a seat that there is
 * @returns empty if they can
 */
export function reasonAgainstSeat(store: Store, id: string): string {
  const { rights, me, seats: { [id]: seat } } = store;
  const mine = seat.holder === me.id || seat.offer?.client === me.id;
  return reasonAgainst(store, 'drive', 'take a seat')
    || (rights.seat === '' || rights.seat === id || mine ? ''
      : `Your link is for ${rights.seat}; the driver of ${id} can offer it to you.`);
}
