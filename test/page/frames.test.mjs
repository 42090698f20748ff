// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Frames are read as crgame_ros/cockpit/frames.py writes them. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { decodeFrame, KIND, VEHICLE, VEHICLE_WIDTH } from
  '../../page/cockpit/js/frames.js';
import { close, frameOf, stateFrame } from './support.mjs';

const HEAD = [3, 120, 12, 1.2];

test('a state has its head and a row of 13 for each vehicle', () => {
  const frame = decodeFrame(stateFrame({ epoch: 3, n: 120, k: 12, t: 1.2 },
    [1, 2, 0.5, 20], [4, 5, -0.5, 10, 0, 0, 0, 0, 0, 0, 0, 1]));
  assert.deepEqual([frame.kind, frame.epoch, frame.n, frame.k, frame.t], [1, 3, 120, 12, 1.2]);
  assert.equal(frame.vehicles.length, 2 * VEHICLE_WIDTH);
  assert.equal(frame.vehicles[VEHICLE.speed], 20);
  assert.equal(frame.vehicles[VEHICLE_WIDTH + VEHICLE.yaw], -0.5);
  assert.equal(frame.vehicles[VEHICLE_WIDTH + VEHICLE.reverse], 1);
});

test('the columns of a vehicle fill its row', () => {
  const columns = Object.values(VEHICLE);
  assert.deepEqual(columns.toSorted((a, b) => a - b), [...Array(VEHICLE_WIDTH).keys()]);
});

test('nothing is copied', () => {
  const buffer = stateFrame({ n: 1, t: 0.01 }, [7]);
  const { vehicles } = decodeFrame(buffer);
  new DataView(buffer).setFloat64(6 * 8, 9, true);
  assert.equal(vehicles[0], 9);
});

test('objects have six values each', () => {
  const { kind, objects } = decodeFrame(frameOf(KIND.OBJECTS, ...HEAD, 2,
    ...[1, 2, 3, 4, 5, 6], ...[7, 8, 9, 10, 11, 12]));
  assert.equal(kind, KIND.OBJECTS);
  close(objects, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]);
});

test('a plan has its vehicle and five values a point', () => {
  const { index, points } = decodeFrame(frameOf(KIND.PLAN, ...HEAD, 4, 2,
    ...[1, 2, 3, 4, 0], ...[5, 6, 7, 8, 0.1]));
  assert.equal(index, 4);
  close(points, [1, 2, 3, 4, 0, 5, 6, 7, 8, 0.1]);
});

test('predictions: for each column as many points of three values as there are steps', () => {
  const { index, steps, entries } = decodeFrame(frameOf(KIND.PREDICTION, ...HEAD, 1, 2, 2,
    5, ...[1, 2, 3], ...[4, 5, 6], 7, ...[10, 20, 30], ...[40, 50, 60]));
  assert.deepEqual([index, steps], [1, 2]);
  assert.deepEqual(entries.map(({ column }) => column), [5, 7]);
  close(entries[0].points, [1, 2, 3, 4, 5, 6]);
  close(entries[1].points, [10, 20, 30, 40, 50, 60]);
});

test('a scan has nine values and its ranges', () => {
  const scan = decodeFrame(frameOf(KIND.SCAN, ...HEAD, 1, 2, 10, 20, 0.5, -1, 0.1, 80, 0.05,
    3, 5, Infinity, 7));
  const { index, sensor, x, y, yaw, first, increment, longest, period_s } = scan;
  close([index, sensor, x, y, yaw, first, increment, longest, period_s],
    [1, 2, 10, 20, 0.5, -1, 0.1, 80, 0.05]);
  close(scan.ranges, [5, Infinity, 7]);
});

test('an estimate has its pose, motion and covariance', () => {
  const { index, x, y, yaw, speed, yaw_rate, xx, xy, yy } = decodeFrame(
    frameOf(KIND.ESTIMATE, ...HEAD, 2, 10, 20, 0.5, 15, 0.1, 0.04, 0.01, 0.09));
  close([index, x, y, yaw, speed, yaw_rate, xx, xy, yy],
    [2, 10, 20, 0.5, 15, 0.1, 0.04, 0.01, 0.09]);
});

test('the seen vehicles come as columns', () => {
  const { index, columns } = decodeFrame(frameOf(KIND.SEEN, ...HEAD, 1, 3, 0, 4, 9));
  assert.equal(index, 1);
  close(columns, [0, 4, 9]);
});

test('a map is read bit by bit, 64 cells to a value', () => {
  // 10 x 7 cells are 70 bits: two values of 8 bytes.
  const buffer = frameOf(KIND.OCCUPANCY, ...HEAD, -5, -6, 0.5, 10, 7, 0, 0);
  new Uint8Array(buffer)[8 * 10 + 8] = 0b100;
  const map = decodeFrame(buffer);
  assert.deepEqual([map.x, map.y, map.resolution, map.rows, map.columns], [-5, -6, 0.5, 10, 7]);
  assert.equal(map.bits.length, 16);
  const occupied = [...Array(70).keys()].filter((cell) => map.bits[cell >> 3] >> (cell & 7) & 1);
  assert.deepEqual(occupied, [66]);
});

test('an unknown kind is no error: a newer server may send it', () => {
  assert.equal(decodeFrame(frameOf(99, ...HEAD)), null);
});

for (const [name, values] of Object.entries({
  'two vehicles and one row': [KIND.STATE, ...HEAD, 2, ...Array(13).fill(0)],
  'no number of vehicles': [KIND.STATE, ...HEAD, NaN],
  'fewer than none': [KIND.OBJECTS, ...HEAD, -1],
  'a plan without its points': [KIND.PLAN, ...HEAD, 0, 3, 1, 2, 3, 4, 5],
  'a prediction cut in a point': [KIND.PREDICTION, ...HEAD, 0, 2, 1, 5, 1, 2, 3, 4],
  'a scan without ranges': [KIND.SCAN, ...HEAD, 1, 2, 10, 20, 0.5, -1, 0.1, 80, 0.05, 3, 1],
  'an estimate without covariance': [KIND.ESTIMATE, ...HEAD, 2, 10, 20, 0.5, 15, 0.1],
  'a map of 70 cells in one value': [KIND.OCCUPANCY, ...HEAD, 0, 0, 1, 10, 7, 0],
})) {
  test(`a frame that is too short is refused: ${name}`, () => {
    assert.throws(() => decodeFrame(frameOf(...values)), RangeError);
  });
}
