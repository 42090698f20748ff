// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** What a role may not do, and whose a seat is, in words. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { describeSeat } from '../../crgame_ros/cockpit/page/js/driving/seat_text.js';
import { reasonAgainst } from '../../crgame_ros/cockpit/page/js/rights.js';

const DRIVER = { role: 'driver', directs: false, drives: true, seat: '' };

test('a role is told why it cannot, and told nothing of what it can', () => {
  const store = { mode: 'live', rights: DRIVER };
  assert.equal(reasonAgainst(store, 'direct', 'reset the run'),
    'Only a director can reset the run; you are a driver.');
  assert.equal(reasonAgainst(store, 'drive', 'take a seat'), '');
  assert.equal(reasonAgainst({ ...store, mode: 'replay' }, 'direct', 'reset the run'), '');
  // Before the server has said who somebody is.
  assert.equal(reasonAgainst({ ...store, rights: { ...DRIVER, role: '' } }, 'direct', 'x'), '');
});

test('a kept seat says for whom and for how long', () => {
  const seat = { source: 'cockpit', driver: 'cockpit', holder: null, holder_name: null };
  assert.equal(describeSeat({ ...seat, kept: { name: 'Anna', for_s: 42 } }, 'human', '', 'c1'),
    'Kept for Anna for 42 s');
  assert.equal(describeSeat({ ...seat, kept: null }, 'human', '', 'c1'),
    'Waits for somebody in a cockpit');
});
