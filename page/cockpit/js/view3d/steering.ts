// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The steering angle of a recorded vehicle, derived from its motion. */

// Largest steering angle of cars [rad].
const MOST = 0.65;
// Below this speed, the quotient is unreliable: the wheels straighten up to standstill [m/s].
const SLOW = 1;

/**
 * Return the steering angle of a single-track model with this motion:
 * tan(angle) = wheelbase * yaw rate / speed.
 * @param wheelbase [m]
 * @param speed along its heading, below 0 backwards [m/s]
 * @param yaw_rate [rad/s]
 * @returns [rad], positive to the left; 0 at standstill
 */
export function steeringOf(wheelbase: number, speed: number, yaw_rate: number): number {
  if (Math.abs(speed) < Number.EPSILON) {
    return 0;
  }
  const angle = Math.atan(wheelbase * yaw_rate / speed);
  return Math.min(Math.max(angle, -MOST), MOST) * Math.min(Math.abs(speed) / SLOW, 1) ** 2;
}
