// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Indicators and horn: when they are on, and the device buttons that switch them. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { defaultProfile, loadProfile, saveProfile } from
  '../../page/cockpit/js/driving/gamepad_profile.js';
import { interpolateVehicles } from '../../page/cockpit/js/interpolation.js';
import { VEHICLE, VEHICLE_WIDTH } from '../../page/cockpit/js/frames.js';
import { LIGHT, shining } from '../../page/cockpit/js/lights.js';
import { keepStorage } from './support.mjs';

const DARK = { left: false, right: false, horn: false, brake: false, blue: false };

test('indicators blink three times in two seconds of simulation time, the horn sounds on', () => {
  const all = LIGHT.left | LIGHT.right | LIGHT.horn;
  const times = Array.from({ length: 2000 }, (_, i) => i / 1000);
  const lit = times.map((t) => shining(all, t).left);
  assert.equal(lit.filter((on, i) => on && !(i > 0 && lit[i - 1])).length, 3);
  assert.ok(Math.abs(lit.filter(Boolean).length - 1000) <= 3, 'half of the time');
  assert.ok(times.every((t) => shining(all, t).horn));
  assert.deepEqual(shining(LIGHT.right, 0), { ...DARK, right: true });
});

test('a vehicle without a command has no lights', () => {
  for (const lights of [NaN, undefined, 0]) {
    assert.deepEqual(shining(lights, 0), DARK);
  }
});

test('blue lights flash twice a second, brake lights shine on', () => {
  const times = Array.from({ length: 1000 }, (_, i) => i / 1000);
  const lit = times.map((t) => shining(LIGHT.blue | LIGHT.brake, t));
  assert.equal(lit.filter(({ blue }, i) => blue && !(i > 0 && lit[i - 1].blue)).length, 2);
  assert.ok(lit.every(({ brake, left, right }) => brake && !left && !right));
});

test('lights are not interpolated', () => {
  const [before, after, out] = [0, 0, 0].map(() => new Float64Array(VEHICLE_WIDTH));
  before[VEHICLE.lights] = LIGHT.left;
  after[VEHICLE.lights] = LIGHT.horn;
  interpolateVehicles(out, before, after, 0.5);
  assert.equal(out[VEHICLE.lights], LIGHT.left);
});

test('a calibration from before there were indicators gets the default buttons', () => {
  const kept = keepStorage();
  const wheel = { id: 'X (Vendor: 046d Product: c26e)', index: 0, axes: [0, 1, 1, 1], buttons: [],
    mapping: '' };
  const { lights, ...own } = defaultProfile(wheel);
  assert.deepEqual(lights, { left_indicator: [9], right_indicator: [8], hazard: [3], horn: [0] });
  own.steering.deadzone = 0.25;
  saveProfile(wheel.id, own);
  assert.deepEqual(loadProfile(wheel), { profile: { ...own, lights }, calibrated: true });
  kept.clear();
});
