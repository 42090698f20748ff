// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The pose of a driven vehicle on the road. */

import { VEHICLE, VEHICLE_WIDTH } from '../frames.js';
import { poseOf } from './traffic.js';

import type { SceneVehicle } from '../messages.js';
import type { Shown } from '../store.js';
import type { Stand } from './cameras.js';
import type { HeightAt } from './traffic.js';

/**
 * Return the pose of a vehicle's rear axle on the road, and the slope.
 * @param index of the vehicle
 * @returns null while it has no place
 */
export function standOf(shown: Shown, index: number, vehicle: SceneVehicle,
  heightAt: HeightAt): Stand | null {
  const row = index * VEHICLE_WIDTH;
  const [x, y] = [shown.vehicles[row], shown.vehicles[row + 1]];
  const yaw = shown.vehicles[row + VEHICLE.yaw];
  if (!Number.isFinite(x + y + yaw)) {
    return null;
  }
  const ahead = vehicle.rear_to_center;
  const { z, slope } = poseOf(x + ahead * Math.cos(yaw), y + ahead * Math.sin(yaw), yaw,
    0.35 * vehicle.shape.length, heightAt);
  return { x, y, yaw, z: z - ahead * Math.sin(slope), slope };
}
