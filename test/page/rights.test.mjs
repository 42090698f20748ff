// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The limits of a role and the holder of a seat, in words. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { describeSeat } from '../../page/cockpit/js/driving/seat_text.js';
import {
  reasonAgainst, reasonAgainstOrder, reasonAgainstSeat,
} from '../../page/cockpit/js/rights.js';
import { Store } from '../../page/cockpit/js/store.js';

const DRIVER = { role: 'driver', directs: false, drives: true, seat: '' };

test('a role gets a reason for forbidden actions and none for allowed ones', () => {
  const store = { mode: 'live', rights: DRIVER };
  assert.equal(reasonAgainst(store, 'direct', 'reset the run'),
    'Only a director can reset the run; you are a driver.');
  assert.equal(reasonAgainst(store, 'drive', 'take a seat'), '');
  assert.equal(reasonAgainst({ ...store, mode: 'replay' }, 'direct', 'reset the run'), '');
  // Before the server has sent the role.
  assert.equal(reasonAgainst({ ...store, rights: { ...DRIVER, role: '' } }, 'direct', 'x'), '');
});

test('a driver in the seat may start the run before its first step, and no more', () => {
  const storeOf = (more) => Object.assign(new Store(), { mode: 'live', rights: DRIVER,
    me: { id: 'c1' }, status: { n: 0 }, seats: { hv0: { holder: 'c1' }, hv1: { holder: null } },
    ...more });
  const store = storeOf({});
  const refused = (action) => `Only a director can ${action} the run; you are a driver.`;
  assert.equal(reasonAgainstOrder(store, 'start'), '');
  assert.equal(reasonAgainstOrder(store, 'reset'), refused('reset'));
  assert.equal(reasonAgainstOrder(storeOf({ status: { n: 1 } }), 'start'), refused('start'));
  assert.equal(reasonAgainstOrder(storeOf({ me: { id: 'c2' } }), 'start'), refused('start'));
  assert.equal(reasonAgainstOrder(
    storeOf({ rights: { ...DRIVER, directs: true } }), 'reset'), '');
});

test('a link for one seat admits to no other, unless it is offered', () => {
  const store = { mode: 'live', rights: { ...DRIVER, seat: 'hv0' }, me: { id: 'c1' },
    seats: { hv0: { holder: null }, hv1: { holder: null },
      hv2: { holder: 'c2', offer: { client: 'c1' } } } };
  assert.equal(reasonAgainstSeat(store, 'hv0'), '');
  assert.match(reasonAgainstSeat(store, 'hv1'), /^Your link is for hv0; the driver of hv1/);
  assert.equal(reasonAgainstSeat(store, 'hv2'), '');
  assert.match(reasonAgainstSeat({ ...store, rights: { ...DRIVER, drives: false } }, 'hv0'),
    /^Only a driver can take a seat/);
});

test('a kept seat names its driver and the remaining time', () => {
  const seat = { source: 'cockpit', driver: 'cockpit', holder: null, holder_name: null };
  assert.equal(describeSeat({ ...seat, kept: { name: 'Anna', for_s: 42 } }, 'human', '', 'c1'),
    'Kept for Anna for 42 s');
  assert.equal(describeSeat({ ...seat, kept: null }, 'human', '', 'c1'),
    'Waits for a driver in a cockpit');
});
