// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** An AV's perception: unseen vehicles, its own estimate, and how long both are valid. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { KIND, OBJECT_WIDTH, VEHICLE_WIDTH } from '../../page/cockpit/js/frames.js';
import { Perceived } from '../../page/cockpit/js/perceived.js';
import { ellipse } from '../../page/cockpit/js/perception/estimate_layer.js';
import { Unseen } from '../../page/cockpit/js/perception/unseen.js';
import { close } from './support.mjs';

const rows = (width, ...places) => Float64Array.from(
  places.flatMap(([x, y]) => [x, y, ...Array(width - 2).fill(0)]));
const SCENE = {
  vehicles: [{ id: 'hv0', perception: null }, { id: 'av0', perception: { range: 50 } },
    { id: 'av1', perception: null }],
  objects: [{ id: '7' }, { id: '8' }, { id: '9' }],
};
const SHOWN = {
  vehicles: rows(VEHICLE_WIDTH, [1010, 500], [1000, 500], [900, 500]),
  // At exactly the range, beyond it, and absent.
  objects: rows(OBJECT_WIDTH, [1030, 540], [1050.1, 500], [NaN, NaN]),
};

test('all vehicles are hollow but the AV itself and those that it sees', () => {
  const unseen = new Unseen(SCENE);
  assert.equal(unseen.perceiving('av0'), 1);
  assert.equal(unseen.perceiving('hv0'), -1);
  assert.equal(unseen.perceiving(null), -1);
  assert.deepEqual([...unseen.flags(1, Float64Array.of(3, 5))], [1, 0, 1, 0, 1, 0]);
  assert.deepEqual([...unseen.flags(1, Float64Array.of())], [1, 0, 1, 1, 1, 1]);
});

test('the counts are of vehicles within the range, and of those seen among them', () => {
  const unseen = new Unseen(SCENE);
  assert.deepEqual(unseen.count(1, Float64Array.of(3, 4), SHOWN), { seen: 1, near: 2, range: 50 });
  const far = new Unseen({ ...SCENE, vehicles: [SCENE.vehicles[0],
    { id: 'av0', perception: { range: null } }, SCENE.vehicles[2]] });
  // Without a limit all present vehicles count; 8 is seen too.
  assert.deepEqual(far.count(1, Float64Array.of(3, 4), SHOWN), { seen: 2, near: 4, range: null });
});

test('the ellipse of a covariance along the axes', () => {
  close(Object.values(ellipse({ xx: 9, xy: 0, yy: 4 })), [6, 4, 0]);
  close(Object.values(ellipse({ xx: 4, xy: 0, yy: 9 })), [6, 4, Math.PI / 2]);
  close(Object.values(ellipse({ xx: 0, xy: 0, yy: 0 })).slice(0, 2), [0, 0]);
});

test('a covariance that is turned gives the same ellipse, turned', () => {
  const [cos, sin] = [Math.cos(0.4), Math.sin(0.4)];
  // R diag(9, 4) R^T
  close(Object.values(ellipse({
    xx: 9 * cos * cos + 4 * sin * sin, xy: 5 * cos * sin, yy: 9 * sin * sin + 4 * cos * cos,
  })), [6, 4, 0.4]);
});

const seen = (t, ...columns) => (
  { kind: KIND.SEEN, index: 1, n: 0, t, columns: Float64Array.from(columns) });

test('the planner\'s request is valid for a second', () => {
  const perceived = new Perceived();
  assert.equal(perceived.seenBy(1, 0), null);
  perceived.add(seen(10, 0, 2));
  close(perceived.seenBy(1, 10.99), [0, 2]);
  assert.equal(perceived.seenBy(1, 11.01), null);
  assert.equal(perceived.seenBy(0, 10), null);
  // The display is behind by less than half a second.
  close(perceived.seenBy(1, 9.6), [0, 2]);
  assert.equal(perceived.seenBy(1, 9.4), null);
});

const estimate = (n, more) => ({ kind: KIND.ESTIMATE, index: 1, n, t: n / 100, x: 0, y: 0, yaw: 0,
  speed: 0, yaw_rate: 0, xx: 1, xy: 0, yy: 1, ...more });

test('an estimate is extrapolated along its motion', () => {
  const perceived = new Perceived();
  perceived.add(estimate(100, { x: 5, yaw: Math.PI / 2, speed: 10, xx: 0.5 }));
  const { n, x, y, yaw, xx } = perceived.estimateOf(1, 1.2);
  close([n, x, y, yaw, xx], [100, 5, 2, Math.PI / 2, 0.5]);
});

test('in a bend it is extrapolated along the circle up to the third order', () => {
  const perceived = new Perceived();
  perceived.add(estimate(100, { speed: 10, yaw_rate: 0.5 }));
  const { x, y, yaw } = perceived.estimateOf(1, 1.1);
  // Radius 20 m, 0.05 rad of it.
  close([x, y], [20 * Math.sin(0.05), 20 * (1 - Math.cos(0.05))], 1.1e-4);
  close(yaw, 0.05);
});

test('the estimate of the shown time counts, and none that is too old', () => {
  const perceived = new Perceived();
  [100, 110, 120].forEach((n) => perceived.add(estimate(n, { x: n })));
  assert.deepEqual([1.05, 1.1, 1.15, 1.2, 1.69].map((t) => perceived.estimateOf(1, t).n),
    [100, 110, 110, 120, 120]);
  assert.equal(perceived.estimateOf(1, 1.71), null);
  assert.equal(perceived.estimateOf(0, 1.1), null);
});

test('an estimate beyond half a turn comes out within it', () => {
  const perceived = new Perceived();
  perceived.add(estimate(100, { yaw: 3, yaw_rate: 2 }));
  close(perceived.estimateOf(1, 1.2).yaw, 3.4 - 2 * Math.PI);
});

test('scans: the newest of each sensor, for two periods and 0.3 s', () => {
  const perceived = new Perceived();
  const scan = (sensor, t, index = 1) => perceived.add(
    { kind: KIND.SCAN, index, sensor, t, period_s: 0.1 });
  scan(0, 1.0);
  scan(0, 1.1);
  scan(1, 1.05);
  scan(0, 1.1, 2);
  assert.deepEqual(perceived.scansOf(1, 1.2).map(({ sensor, t }) => [sensor, t]),
    [[0, 1.1], [1, 1.05]]);
  assert.deepEqual(perceived.scansOf(1, 1.57).map(({ sensor }) => sensor), [0]);
  assert.deepEqual(perceived.scansOf(1, 1.61), []);
});

test('a reset clears the perception and keeps the map', () => {
  const perceived = new Perceived();
  const map = { kind: KIND.OCCUPANCY, rows: 1 };
  perceived.add(map);
  perceived.add(seen(0));
  perceived.clear();
  assert.equal(perceived.seenBy(1, 0), null);
  assert.equal(perceived.occupancy, map);
});
