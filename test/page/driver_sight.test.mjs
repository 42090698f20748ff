// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The vehicles that a driver sees in fog, on the map and in words. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

const WORLD = '../../page/cockpit/js/world';
const { describeAround } = await import(`${WORLD}/around.js`);
const { driverSight, hideBeyond } = await import(`${WORLD}/driver_sight.js`);
const { OBJECT_WIDTH, VEHICLE_WIDTH } = await import(
  '../../page/cockpit/js/frames.js');

/** Rows of things that stand on a line. */
function rowsAt(width, ...xs) {
  const rows = new Float64Array(width * xs.length);
  xs.forEach((x, i) => rows.set([x, 7], i * width));
  return rows;
}

/** The x of each row. */
const xsOf = (rows, width) => [...rows].filter((_, i) => i % width === 0);

test('vehicles beyond the range of sight are removed, the own vehicle never', () => {
  const shown = { vehicles: rowsAt(VEHICLE_WIDTH, 1000, 940, 939),
    objects: rowsAt(OBJECT_WIDTH, 1060, 1061, NaN) };
  hideBeyond(shown, 0, 60);
  assert.deepEqual(xsOf(shown.vehicles, VEHICLE_WIDTH), [1000, 940, NaN]);
  assert.deepEqual(xsOf(shown.objects, OBJECT_WIDTH), [1060, NaN, NaN]);
});

test('an absent seat removes no vehicle', () => {
  for (const own of [-1, 1]) {
    const shown = { vehicles: rowsAt(VEHICLE_WIDTH, 0, NaN), objects: rowsAt(OBJECT_WIDTH, 500) };
    hideBeyond(shown, own, 60);
    assert.deepEqual(xsOf(shown.vehicles, VEHICLE_WIDTH), [0, NaN]);
    assert.deepEqual(xsOf(shown.objects, OBJECT_WIDTH), [500]);
  }
});

test('a driver, or a view from the driver\'s eyes, has the range of sight of the air', () => {
  const store = { scene: { environment: { visibility: 80 } } };
  const from = (parts) => {
    globalThis.window = { crgame: parts };
    return driverSight(store)?.id ?? null;
  };
  const view3d = { on: true, viewpoint: 'driver', vehicle: 'av0' };
  assert.equal(from({}), null);
  assert.equal(from({ driving: { seat: null }, view3d: { ...view3d, on: false } }), null);
  assert.equal(from({ view3d: { ...view3d, viewpoint: 'chase' } }), null);
  assert.equal(from({ view3d }), 'av0');
  assert.equal(from({ driving: { seat: null }, stage: { address: { seat: 'av1' } } }), 'av1');
  assert.equal(from({ driving: { seat: 'hv0' }, view3d }), 'hv0');
  assert.equal(driverSight(store).range, 80);
  assert.equal(driverSight({ scene: null }), null);
  delete globalThis.window;
});

test('words name no vehicle that fog hides', () => {
  const body = (id, x) => ({ id, x, y: 0, yaw: 0, speed: 0 });
  const others = [body('car 1', 50), body('car 2', 70), body('car 3', 120)];
  const text = (range) => describeAround(body('hv0', 0), others, true, range);
  assert.match(text(60), /Around: car 1 50 m ahead, standing\.$/);
  assert.match(text(40), /No other within 40 m\.$/);
  assert.match(text(30000), /car 1 50 m .*; car 2 70 m /);
  assert.doesNotMatch(text(undefined), /car 3/);
});
