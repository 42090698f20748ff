// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Vehicles between and beyond their samples, compared with the motion in closed form. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { VEHICLE, VEHICLE_WIDTH } from '../../page/cockpit/js/frames.js';
import { extrapolateVehicles, interpolateVehicles, moveObjects, turn } from
  '../../page/cockpit/js/interpolation.js';
import { close } from './support.mjs';

const vehicle = (values) => Float64Array.from(
  { length: VEHICLE_WIDTH }, (_, i) => values[Object.keys(VEHICLE)[i]] ?? 0);

test('turning takes the shortest way, also across pi', () => {
  close(turn(0, 1, 0.25), 0.25);
  // From 3 to -3 it is 2 pi - 6 to the left, not 6 to the right.
  close(turn(3, -3, 0.5), 3 + (2 * Math.PI - 6) / 2);
  close(turn(-3, 3, 0.5), -3 - (2 * Math.PI - 6) / 2);
  close(turn(0.1, 0.1 + 4 * Math.PI, 1), 0.1, 1e-12);
});

test('half way between two samples is their mean; the yaw turns the short way', () => {
  const before = vehicle({ x: 0, y: 10, yaw: 3, speed: 10, throttle: 0.2 });
  const after = vehicle({ x: 1, y: 20, yaw: -3, speed: 12, throttle: 0.4 });
  const out = new Float64Array(VEHICLE_WIDTH);
  interpolateVehicles(out, before, after, 0.5);
  close([out[0], out[1], out[VEHICLE.speed], out[VEHICLE.throttle]], [0.5, 15, 11, 0.3]);
  close(Math.abs(out[VEHICLE.yaw]), Math.PI);
});

test('a gear is not interpolated, and a value that ends stays until then', () => {
  const before = vehicle({ reverse: 0, steering: 0.4 });
  const after = vehicle({ reverse: 1, steering: NaN });
  const out = new Float64Array(VEHICLE_WIDTH);
  interpolateVehicles(out, before, after, 0.9);
  assert.equal(out[VEHICLE.reverse], 0);
  close(out[VEHICLE.steering], 0.4);
});

test('a vehicle that was absent appears with the next sample only', () => {
  const out = new Float64Array(VEHICLE_WIDTH);
  interpolateVehicles(out, vehicle({ x: NaN }), vehicle({ x: 5 }), 0.5);
  assert.ok(Number.isNaN(out[VEHICLE.x]));
});

test('straight on: position is speed times time', () => {
  const out = new Float64Array(VEHICLE_WIDTH);
  extrapolateVehicles(out, vehicle({ x: 1, y: 2, yaw: Math.PI / 6, speed: 20 }), 0.1);
  close([out[0], out[1], out[2]], [1 + 2 * Math.sqrt(3) / 2, 3, Math.PI / 6]);
});

test('in a bend it stays on the circle up to the third order', () => {
  // Radius 20 m at 10 m/s: 0.5 rad/s. The chord along the mean heading misses the arc by
  // v * yaw_rate^2 * dt^3 / 24, 1.05e-4 m at 0.1 s; without the half turn it would be 2.5 cm.
  const dt = 0.1;
  const out = new Float64Array(VEHICLE_WIDTH);
  extrapolateVehicles(out, vehicle({ speed: 10, yaw_rate: 0.5 }), dt);
  close([out[0], out[1]], [20 * Math.sin(0.05), 20 * (1 - Math.cos(0.05))], 1.1e-4);
  close(out[VEHICLE.yaw], 0.05);
});

test('each vehicle moves independently', () => {
  const two = Float64Array.from([...vehicle({ speed: 10 }),
    ...vehicle({ y: 5, yaw: Math.PI / 2, speed: 2 })]);
  const out = new Float64Array(2 * VEHICLE_WIDTH);
  extrapolateVehicles(out, two, 0.5);
  close([out[0], out[1], out[VEHICLE_WIDTH], out[VEHICLE_WIDTH + 1]], [5, 0, 0, 6]);
});

test('objects move with constant velocities', () => {
  const out = new Float64Array(12);
  moveObjects(out, Float64Array.from([1, 2, 0.1, 10, -20, 0.2, 5, 6, 0, 0, 0, 0]), 0.1);
  close(out, [2, 0, 0.12, 10, -20, 0.2, 5, 6, 0, 0, 0, 0]);
});
