// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Reasons, in words, why a person may not use a control of this page. */

import type { Reply, RunAction } from './messages.js';
import type { Store } from './store.js';

/**
 * Return why an action is not allowed here; the server checks it too.
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
 * @returns empty if it can
 */
export function reasonAgainstOrder(store: Store, action: RunAction): string {
  const { status, rights } = store;
  if (action === 'start' && store.own.length > 0 && status?.n === 0 && rights.drives) {
    return '';
  }
  return reasonAgainst(store, 'direct', `${action} the run`);
}

/**
 * Return why this person cannot act on a seat.
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

/** Show the refusal of a request as a notice; return whether there was none. */
export async function tellRefusal(store: Store, reply: Promise<Reply>): Promise<boolean> {
  const { ok, text } = await reply;
  if (!ok) {
    store.receive({ type: 'notice', level: 'warn', text });
  }
  return ok;
}
