// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The speed limit under a vehicle, on lanelets with known places. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { SpeedLimits } from '../../page/cockpit/js/driving/speed_limit.js';
import { laneletOf } from './support.mjs';

const limits = (...lanelets) => new SpeedLimits({ lanelets });
const north = { left: [48, -50, 48, 50], right: [52, -50, 52, 50], center: [50, -50, 50, 50] };

test('the limit holds only inside the lane', () => {
  const road = limits(laneletOf({ speed_limit: 10 }));
  assert.equal(road.at(50, 1.9, 0), 10);
  assert.equal(road.at(50, 2.1, 0), null);
  assert.equal(road.at(101, 0, 0), null);
  assert.equal(new SpeedLimits(null).at(0, 0, 0), null);
});

test('a slanted lane: half of its box is outside it', () => {
  const slanted = { left: [0, 2, 100, 102], right: [0, -2, 100, 98], center: [0, 0, 100, 100] };
  const road = limits(laneletOf({ ...slanted, speed_limit: 10 }));
  const east = Math.PI / 4;
  assert.deepEqual([[50, 50], [50, 51.9], [50, 48.1], [50, 52.1], [50, 47.9], [20, 80], [80, 20]]
    .map(([x, y]) => road.at(x, y, east)), [10, 10, 10, null, null, null, null]);
});

test('a lane without a limit has none', () => {
  assert.equal(limits(laneletOf({ speed_limit: null })).at(50, 0, 0), null);
});

test('at a crossing the limit is that of the lane in the vehicle\'s direction', () => {
  const road = limits(laneletOf({ speed_limit: 10 }),
    laneletOf({ id: 2, ...north, speed_limit: 20 }));
  assert.equal(road.at(50, 0, 0.2), 10);
  assert.equal(road.at(50, 0, Math.PI / 2 - 0.2), 20);
});

test('a one-way lane counts in its direction only, a two-way lane in both', () => {
  const across = laneletOf({ id: 2, ...north, speed_limit: 20 });
  const west = Math.PI - 0.5;
  assert.equal(limits(laneletOf({ speed_limit: 10 }), across).at(50, 0, west), 20);
  assert.equal(limits(laneletOf({ speed_limit: 10, one_way: false }), across).at(50, 0, west), 10);
});

test('in a bend the heading is that of the nearest segment', () => {
  const bend = { left: [0, 2, 48, 2, 48, 50], right: [0, -2, 52, -2, 52, 50],
    center: [0, 0, 50, 0, 50, 50] };
  const road = limits(laneletOf({ ...bend, speed_limit: 10 }),
    laneletOf({ id: 2, left: [0, 42, 100, 42], right: [0, 38, 100, 38],
      center: [0, 40, 100, 40], speed_limit: 20 }));
  assert.equal(road.at(50, 40, Math.PI / 2), 10);
  assert.equal(road.at(50, 40, 0), 20);
  // A lane that goes there, across and back, far from the origin: each segment counts.
  const back = { left: [1000, 2, 1046, 2, 1046, 38, 1000, 38],
    right: [1000, -2, 1050, -2, 1050, 42, 1000, 42],
    center: [1000, 0, 1048, 0, 1048, 40, 1000, 40] };
  const two = limits(laneletOf({ ...back, speed_limit: 10 }), laneletOf(
    { id: 2, length: 2000, y: 20, width: 60, speed_limit: 20 }));
  assert.deepEqual([two.at(1010, 0, 0), two.at(1010, 40, Math.PI), two.at(1010, 40, 0),
    two.at(1048, 20, Math.PI / 2)], [10, 10, 20, 10]);
});
