// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The simulation time that the page shows, for known arrivals. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { DisplayClock } from '../../page/cockpit/js/display_clock.js';
import { close } from './support.mjs';

/** Make samples arrive: every 10 ms of simulation, at times that a function gives. */
function fed(arrival_ms, count = 100, factor = 1) {
  const clock = new DisplayClock();
  clock.factor = factor;
  for (let i = 0; i < count; i += 1) {
    clock.arrived(i / 100, arrival_ms(i));
  }
  return clock;
}

test('even arrivals: one period and the guard of a millisecond behind', () => {
  const clock = fed((i) => 1000 + 10 * i);
  close([clock.rate, clock.period_ms, clock.jitter_ms, clock.delay_ms], [1, 10, 0, 11], 1e-6);
  // The newest, 0.99 s, came at 1990 ms; 4 ms later 0.994 - 0.011 s are shown.
  close(clock.time(1994, 0.99, true), 0.983, 1e-9);
});

test('the delay covers the mean jitter and two standard deviations', () => {
  // Every second sample is late by 6 ms: lateness 0 or 6, mean 3, deviation 3.
  const clock = fed((i) => 1000 + 10 * i + (i % 2 === 0 ? 0 : 6));
  close(clock.jitter_ms, 3 + 2 * 3, 1e-6);
  // 64 of them span 63 periods, and 6 ms more, as the oldest in the window is in time.
  close(clock.period_ms, (630 + 6) / 63, 1e-6);
  close(clock.delay_ms, clock.period_ms + 9 + 1, 1e-6);
});

test('half speed is measured, although full speed was requested', () => {
  const clock = fed((i) => 1000 + 20 * i);
  close(clock.rate, 0.5, 1e-9);
  clock.time(2980, 0.99, true);
  const [before, after] = [clock.time(2985, 0.99, true), clock.time(2995, 0.99, true)];
  close(after - before, 0.005, 1e-9);
});

test('a rate within three per cent of the requested one is the requested rate', () => {
  assert.equal(fed((i) => 1000 + 10.2 * i).rate, 1);
  assert.notEqual(fed((i) => 1000 + 10.4 * i).rate, 1);
});

test('before a measurement the rate is the requested one', () => {
  // Eight samples over at least 150 ms measure it.
  assert.equal(fed((i) => 1000 + 40 * i, 7, 2).rate, 2);
  assert.equal(fed((i) => 1000 + 10 * i, 15, 2).rate, 2);
  close(fed((i) => 1000 + 10 * i, 16, 2).rate, 1);
});

test('the time never goes back after a stall of up to 80 ms', () => {
  for (const stall_ms of [20, 40, 80]) {
    const clock = fed((i) => 1000 + 10 * i);
    let last = -Infinity;
    const look = (now_ms, newest_t) => {
      const shown = clock.time(now_ms, newest_t, true);
      assert.ok(shown >= last, `${stall_ms}: ${shown} after ${last}`);
      last = shown;
    };
    for (let passed_ms = 0; passed_ms < stall_ms; passed_ms += 5) {
      look(1990 + passed_ms, 0.99);
    }
    for (let i = 100; i < 200; i += 1) {
      clock.arrived(i / 100, 1000 + 10 * i + stall_ms);
      look(1000 + 10 * i + stall_ms, i / 100);
    }
    // A second later the stall has left the window of 64 samples: one period and the guard, and
    // what remains of it after two more time constants.
    close(last, 1.99 - 0.011, stall_ms / 1000);
  }
});

test('an error is corrected with a time constant of a quarter of a second', () => {
  const clock = new DisplayClock();
  clock.arrived(0, 1000);
  close(clock.time(1011, 0, true), 0);
  // The second arrives 29 ms too early after the first: lateness 29 and 0 ms, so
  // jitter 14.5 + 2 * 14.5, period 21 and guard 1: it should run 65.5 ms behind.
  clock.arrived(0.05, 1021);
  close(clock.delay_ms, 65.5, 1e-9);
  const [target, free] = [0.05 - 0.0655, 0.01];
  close(clock.time(1021, 0.05, true), free + (target - free) * (1 - Math.exp(-10 / 250)), 1e-12);
});

test('without new samples it stops a tenth of a second beyond the newest', () => {
  const clock = fed((i) => 1000 + 10 * i);
  clock.time(1990, 0.99, true);
  close(clock.time(5000, 0.99, true), 0.99 + 0.1);
  const half = fed((i) => 1000 + 20 * i);
  half.time(2980, 0.99, true);
  close(half.time(9000, 0.99, true), 0.99 + 0.05, 1e-9);
});

test('while the simulation stands still, the newest is shown', () => {
  const clock = fed((i) => 1000 + 10 * i);
  assert.equal(clock.time(2000, 0.99, false), 0.99);
  assert.equal(clock.time(9000, 0.99, false), 0.99);
});

test('after a silence, or a time that goes back, it measures again', () => {
  const clock = fed((i) => 1000 + 20 * i);
  clock.arrived(1, 10_000);
  assert.deepEqual([clock.rate, clock.jitter_ms], [1, 0]);
  clock.arrived(0.5, 10_010);
  close(clock.time(10_010, 0.5, true), 0.5 - 0.011, 1e-9);
});

test('after a reset the next sample is shown at once', () => {
  const clock = fed((i) => 1000 + 10 * i);
  clock.time(2000, 0.99, true);
  clock.reset();
  assert.equal(clock.time(2010, 42, true), 42);
});
