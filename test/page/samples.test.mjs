// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The ring of samples, the search in it, and the past made from it. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { VEHICLE, VEHICLE_WIDTH } from '../../page/cockpit/js/frames.js';
import { addToHistory, emptyHistory } from '../../page/cockpit/js/history.js';
import { SampleRing } from '../../page/cockpit/js/samples.js';
import { countWhile } from '../../page/cockpit/js/search.js';

const sample = (n) => ({ n, t: n / 100 });
const ringOf = (capacity, ...steps) => {
  const ring = new SampleRing(capacity);
  steps.forEach((n) => ring.push(sample(n)));
  return ring;
};
const stepsOf = (ring) => ring.toArray().map(({ n }) => n);

test('the search agrees with a linear scan', () => {
  for (let length = 0; length < 20; length += 1) {
    for (let place = 0; place <= length; place += 1) {
      let asked = 0;
      assert.equal(countWhile(length, (index) => {
        asked += 1;
        assert.ok(index >= 0 && index < length);
        return index < place;
      }), place);
      assert.ok(asked <= Math.ceil(Math.log2(length + 1)), `${asked} questions for ${length}`);
    }
  }
});

test('the oldest samples are overwritten', () => {
  const ring = ringOf(3, 1, 2, 3, 4, 5);
  assert.equal(ring.length, 3);
  assert.deepEqual(stepsOf(ring), [3, 4, 5]);
  assert.equal(ring.newest.n, 5);
  assert.equal(ring.at(0).n, 3);
  assert.equal(ring.at(3), undefined);
  assert.equal(ring.at(-1), undefined);
});

test('a repeated step replaces the first sample', () => {
  const ring = ringOf(3, 1, 2);
  const again = { n: 2, t: 0.02 };
  assert.equal(ring.push(again), true);
  assert.equal(ring.length, 2);
  assert.equal(ring.newest, again);
});

test('a sample older than the newest is refused', () => {
  const ring = ringOf(3, 1, 5);
  assert.equal(ring.push(sample(3)), false);
  assert.deepEqual(stepsOf(ring), [1, 5]);
});

test('samples too close in time are left out', () => {
  const ring = new SampleRing(10, 0.05);
  const taken = [0, 1, 2, 3, 4, 5, 6, 9, 10].filter((n) => ring.push(sample(n)));
  assert.deepEqual(taken, [0, 5, 10]);
});

test('the sample at or before a time, after the ring has wrapped', () => {
  const ring = ringOf(4, 10, 20, 30, 40, 50, 60);
  assert.deepEqual([0.29, 0.3, 0.31, 0.599, 0.6, 9].map((t) => ring.indexAt(t)),
    [-1, 0, 0, 2, 3, 3]);
});

test('an empty ring returns nothing', () => {
  const ring = ringOf(3, 1, 2, 3);
  ring.clear();
  assert.deepEqual([ring.length, ring.newest, ring.indexAt(1)], [0, undefined, -1]);
  assert.ok(ring.push(sample(1)), 'it may begin anew with an older step');
});

test('the past of a vehicle is taken from its own row', () => {
  const past = emptyHistory();
  for (const n of [1, 2]) {
    const vehicles = new Float64Array(2 * VEHICLE_WIDTH);
    vehicles[VEHICLE_WIDTH + VEHICLE.speed] = 10 * n;
    vehicles[VEHICLE.speed] = -1;
    addToHistory(past, { t: n / 10, vehicles }, 1);
  }
  assert.deepEqual([past.t, past.speed, past.x], [[0.1, 0.2], [10, 20], [0, 0]]);
  assert.deepEqual(Object.keys(past).toSorted(), ['t', ...Object.keys(VEHICLE)].toSorted());
});
