// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Interpolation and extrapolation of vehicles between samples and of objects between steps. */

import { OBJECT_WIDTH, VEHICLE, VEHICLE_WIDTH } from './frames.js';

const TURN = 2 * Math.PI;

/**
 * Interpolate from one angle to another by the shortest way.
 * @param from [rad]
 * @param to [rad]
 * @param share 0 gives `from`, 1 the direction of `to`
 * @returns angle [rad]
 */
export function turn(from: number, to: number, share: number): number {
  const difference = to - from;
  return from + share * (difference - TURN * Math.round(difference / TURN));
}

/**
 * Interpolate all vehicles linearly between two samples.
 * @param out rows of VEHICLE_WIDTH, written
 * @param before the sample at or before the time
 * @param after the sample after it
 * @param share of the way, 0 to 1
 */
export function interpolateVehicles(out: Float64Array, before: Float64Array, after: Float64Array,
  share: number) {
  for (let i = 0; i < out.length; i += 1) {
    const column = i % VEHICLE_WIDTH;
    if (column === VEHICLE.yaw) {
      out[i] = turn(before[i], after[i], share);
    } else if (column === VEHICLE.reverse || column === VEHICLE.lights
        || Number.isNaN(after[i])) {
      out[i] = before[i];
    } else {
      out[i] = before[i] + share * (after[i] - before[i]);
    }
  }
}

/**
 * Extrapolate all vehicles from a sample with their speeds and yaw rates.
 * @param out rows of VEHICLE_WIDTH, written
 * @param sample the newest rows
 * @param dt since the sample [s]
 */
export function extrapolateVehicles(out: Float64Array, sample: Float64Array, dt: number) {
  out.set(sample);
  for (let row = 0; row < out.length; row += VEHICLE_WIDTH) {
    const turned = sample[row + VEHICLE.yaw_rate] * dt;
    const heading = sample[row + VEHICLE.yaw] + 0.5 * turned;
    out[row + VEHICLE.x] += sample[row + VEHICLE.speed] * dt * Math.cos(heading);
    out[row + VEHICLE.y] += sample[row + VEHICLE.speed] * dt * Math.sin(heading);
    out[row + VEHICLE.yaw] += turned;
  }
}

/**
 * Extrapolate all objects from their scenario step: pose + velocity * dt, velocities unchanged.
 * @param out rows of OBJECT_WIDTH, written
 * @param sample rows at the step
 * @param dt since the step [s]
 */
export function moveObjects(out: Float64Array, sample: Float64Array, dt: number) {
  for (let row = 0; row < out.length; row += OBJECT_WIDTH) {
    for (let column = 0; column < 3; column += 1) {
      out[row + column] = sample[row + column] + dt * sample[row + column + 3];
      out[row + column + 3] = sample[row + column + 3];
    }
  }
}
