// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The poses of the 3D view's cameras and of their vehicle, in the map's coordinates. */

import { VEHICLE, VEHICLE_WIDTH } from '../frames.js';
import { DEGREE } from '../units.js';
import { poseOf } from './traffic.js';

import type { SceneVehicle } from '../messages.js';
import type { Shown } from '../store.js';
import type { HeightAt } from './traffic.js';

const CHASE_BEHIND_M = 6.5;
const CHASE_ABOVE_M = 3.4;
const CHASE_PITCH = -12 * DEGREE;
const BIRD_ABOVE_M = 55;
const BIRD_AHEAD_M = 12;

export const VIEWPOINTS = ['driver', 'chase', 'bird'] as const;

export type Viewpoint = typeof VIEWPOINTS[number];
export interface Point { x: number; y: number; z: number } // [m]

/**
 * The pose of a vehicle: its rear axle on the road, its heading, and the road's upward slope.
 *
 * [m, rad].
 */
export interface Stand extends Point { yaw: number; slope: number }

/**
 * The pose of a camera. It is turned with the vehicle, by yaw and slope, then within it to the
 * left and upwards; never rolled.
 *
 * [m, rad].
 */
export interface CameraPose extends Point {
  yaw: number;
  slope: number;
  aside: number;
  pitch: number;
}

/**
 * Return a camera at a point of a vehicle.
 * @param point ahead of the rear axle, to the left, above the road [m]
 * @param aside how far it looks to the left of straight ahead [rad]
 * @param pitch how far it looks upwards [rad]
 */
export function mountedAt(stand: Stand, point: Point, aside = 0, pitch = 0): CameraPose {
  const { yaw, slope } = stand;
  // Distance ahead in the plane: on a climbing vehicle, higher points are farther back.
  const ahead = point.x * Math.cos(slope) - point.z * Math.sin(slope);
  return {
    x: stand.x + Math.cos(yaw) * ahead - Math.sin(yaw) * point.y,
    y: stand.y + Math.sin(yaw) * ahead + Math.cos(yaw) * point.y,
    z: stand.z + point.x * Math.sin(slope) + point.z * Math.cos(slope),
    yaw, slope, aside, pitch,
  };
}

/**
 * Return a camera behind and above a vehicle.
 * @param rear end of the vehicle, ahead of its rear axle [m]
 * @param aside how far it looks to the left of straight ahead [rad]
 */
export function chasing(stand: Stand, rear: number, aside = 0): CameraPose {
  const level = { ...stand, slope: 0.5 * stand.slope };
  return mountedAt(level, { x: rear - CHASE_BEHIND_M, y: 0, z: CHASE_ABOVE_M }, aside,
    CHASE_PITCH);
}

/** Return a camera above a vehicle, which drives upwards in the picture. */
export function above(stand: Stand): CameraPose {
  return mountedAt({ ...stand, slope: 0 }, { x: BIRD_AHEAD_M, y: 0, z: BIRD_ABOVE_M }, 0,
    -90 * DEGREE);
}

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
