// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The optics of a mirror: a camera at the mirror image of the driver's eye. */

import { DEGREE } from '../units.js';

import type { DriverPlace } from '../messages.js';
import type { Point } from './cameras.js';


/** A mirror of a vehicle, convex like the side mirrors of cars. */
export interface Mirror {
  name: 'left' | 'right' | 'inner';
  mount: 'left_mirror' | 'right_mirror' | 'inner_mirror'; // its place in the scene document
  width: number; // of its glass [m]
  height: number; // [m]
  radius: number; // of the sphere that it is part of; infinite for a flat one [m]
  aside: number; // direction of its middle, to the left of straight back [rad]
  pitch: number; // above the horizon [rad]
}

/** UN R46: at least 1.2 m for the outer mirrors of cars. */
export const MIRRORS: readonly Mirror[] = Object.freeze([
  { name: 'left', mount: 'left_mirror', width: 0.19, height: 0.13, radius: 1.4,
    aside: -11 * DEGREE, pitch: -3 * DEGREE },
  { name: 'inner', mount: 'inner_mirror', width: 0.24, height: 0.065, radius: Infinity,
    aside: 0, pitch: -2 * DEGREE },
  { name: 'right', mount: 'right_mirror', width: 0.19, height: 0.13, radius: 1.4,
    aside: 9 * DEGREE, pitch: -3 * DEGREE },
]);

/** The camera of a mirror. Its picture is mirrored, left to right. */
export interface MirrorCamera {
  point: Point; // ahead of the rear axle, to the left, above the road [m]
  aside: number; // to the left of straight ahead [rad]
  pitch: number; // above the horizon [rad]
  height: number; // angle of the picture in height [rad]
  aspect: number; // width of the picture through its height
  near: number; // plane, at the glass [m]
}

/**
 * Return the camera of a mirror.
 *
 * The glass stands across the line on which the driver sees its middle. The eye at distance d has
 * its image behind the glass at 1/d' = 1/d + 2/R (the mirror equation for a far eye, f = -R/2).
 * @param place eyes and mirrors of the vehicle
 * @returns null without this mirror
 */
export function mirrorCamera(mirror: Mirror, place: DriverPlace): MirrorCamera | null {
  const glass = place[mirror.mount];
  if (glass === null) {
    return null;
  }
  const distance = Math.hypot(...glass.map((value, axis) => value - place.eye[axis]));
  const behind = 1 / (1 / distance + 2 / mirror.radius);
  const aside = Math.PI + mirror.aside;
  const along = Math.cos(mirror.pitch);
  return {
    point: {
      x: glass[0] - behind * along * Math.cos(aside),
      y: glass[1] - behind * along * Math.sin(aside),
      z: glass[2] - behind * Math.sin(mirror.pitch),
    },
    aside, pitch: mirror.pitch, near: behind,
    height: 2 * Math.atan((0.5 * mirror.height) / behind), aspect: mirror.width / mirror.height,
  };
}
