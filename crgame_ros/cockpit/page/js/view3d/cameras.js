// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** From where the 3D view looks: the poses of its cameras, in the map's coordinates. */

const DEGREE = Math.PI / 180;
const CHASE_BEHIND_M = 9;
const CHASE_ABOVE_M = 3.6;
const CHASE_PITCH = -11 * DEGREE;
const BIRD_ABOVE_M = 60;

/** What one can look from. */
export const VIEWPOINTS = /** @type {const} */ (['driver', 'chase', 'bird']);

/**
 * @typedef {typeof VIEWPOINTS[number]} Viewpoint
 * @typedef {{x: number, y: number, z: number}} Point [m]
 * @typedef {{x: number, y: number, yaw: number}} RearAxle where a vehicle is [m, rad]
 */

/**
 * Where a camera is and looks: yaw from east to the left, pitch above the horizon, no roll.
 *
 * @typedef {Point & {yaw: number, pitch: number}} CameraPose [m, rad]
 */

/**
 * Put a camera at a point of a vehicle.
 *
 * @param {RearAxle} pose of its rear axle
 * @param {number} ground height of the road there [m]
 * @param {Point} point ahead of the rear axle, to the left, above the road [m]
 * @param {number} [aside] how far it looks to the left of straight ahead [rad]
 * @param {number} [pitch] [rad]
 * @returns {CameraPose}
 */
export function mountedAt({ x, y, yaw }, ground, point, aside = 0, pitch = 0) {
  const cos = Math.cos(yaw);
  const sin = Math.sin(yaw);
  return {
    x: x + cos * point.x - sin * point.y, y: y + sin * point.x + cos * point.y,
    z: ground + point.z, yaw: yaw + aside, pitch,
  };
}

/**
 * Follow a vehicle from behind and above.
 *
 * @param {RearAxle} pose of its rear axle
 * @param {number} ground height of the road there [m]
 * @param {number} size length of the vehicle [m]
 * @returns {CameraPose}
 */
export function chasing(pose, ground, size) {
  return mountedAt(pose, ground, { x: -CHASE_BEHIND_M - size / 2, y: 0,
    z: CHASE_ABOVE_M }, 0, CHASE_PITCH);
}

/**
 * Look down on a vehicle, which drives upwards in the picture.
 *
 * @param {RearAxle} pose of its rear axle
 * @param {number} ground height of the road there [m]
 * @returns {CameraPose}
 */
export function above(pose, ground) {
  return { x: pose.x, y: pose.y, z: ground + BIRD_ABOVE_M, yaw: pose.yaw, pitch: -Math.PI / 2 };
}
