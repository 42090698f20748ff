// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The server's clock is that of the quickest ping, with half of its round trip as the error. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { ServerClock } from '../../page/cockpit/js/server_clock.js';

// The server's clock is 250 s ahead of the page's.
const SERVER_S = 250;

/**
 * @param {ServerClock} clock
 * @param {number} sent_ms
 * @param {number} there_ms on the way to the server
 * @param {number} back_ms
 */
function ping(clock, sent_ms, there_ms, back_ms) {
  clock.add(sent_ms, sent_ms + there_ms + back_ms, SERVER_S + (sent_ms + there_ms) / 1000);
}

test('a time is within the stated error, whichever way delays a ping', () => {
  const clock = new ServerClock();
  assert.equal(clock.at(0), null);
  for (const [there_ms, back_ms] of [[40, 2], [3, 50], [2, 1], [1, 80]]) {
    ping(clock, 1000, there_ms, back_ms);
    const found = clock.at(5000);
    assert.ok(found);
    assert.ok(Math.abs(found.steady_s - SERVER_S - 5) * 1000 <= found.clock_error_ms + 1e-6);
  }
  assert.ok(Math.abs((clock.at(0)?.clock_error_ms ?? 0) - 1.5) < 1e-9);
});

test('old pings and other servers are forgotten', () => {
  const clock = new ServerClock();
  ping(clock, 0, 0.5, 0.5);
  for (let number = 1; number <= 60; number += 1) {
    ping(clock, 1000 * number, 5, 5);
  }
  assert.ok(Math.abs((clock.at(0)?.clock_error_ms ?? 0) - 5) < 1e-9);
  clock.add(0, 10, NaN);
  clock.forget();
  assert.equal(clock.at(0), null);
});
