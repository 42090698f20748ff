// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** What distance, direction and movement make of a sound on its way to an ear. */

/** Of sound in air at 20 °C [m/s]. */
export const SOUND_SPEED = 343;
/** Beyond this nobody is heard [m]. */
export const RANGE_M = 100;
// Nearer than this nothing gets louder [m].
const NEAR_M = 2;
// What comes from nearer than this is no longer wholly at one side [m].
const AROUND_M = 1.5;
// Beyond it a wrong state, not a vehicle, would be heard [m/s].
const MOST_SPEED = 100;

/**
 * @typedef {{x: number, y: number, yaw: number, vx: number, vy: number}} Moving a point with its
 *   heading and velocity in frame map [m, rad, m/s]
 * @typedef {{distance: number, pan: number, doppler: number}} Arrival
 */

/**
 * By how much a tone is higher where it is heard, in air that stands: c / (c - v) for a source
 * that comes nearer at v, (c + v) / c for an ear that does.
 *
 * @param {number} source at which the source approaches the ear [m/s]
 * @param {number} ear at which the ear approaches the source [m/s]
 * @returns {number} heard frequency over the source's
 */
export function dopplerFactor(source, ear) {
  return (SOUND_SPEED + clip(ear, MOST_SPEED)) / (SOUND_SPEED - clip(source, MOST_SPEED));
}

/**
 * Pressure falls with 1 / distance, and fades to nothing at the range.
 *
 * @param {number} distance [m]
 * @returns {number} 1 near by, 0 beyond RANGE_M
 */
export function attenuation(distance) {
  const faded = 1 - (distance / RANGE_M) ** 2;
  return Math.max(faded, 0) * NEAR_M / Math.max(distance, NEAR_M);
}

/**
 * @param {Moving} ear of a driver
 * @param {Moving} source
 * @returns {Arrival} distance [m], pan (-1 left, 0 ahead or behind, 1 right), Doppler factor
 */
export function arrival(ear, source) {
  const dx = source.x - ear.x;
  const dy = source.y - ear.y;
  const distance = Math.hypot(dx, dy);
  if (distance < 1e-6) {
    return { distance, pan: 0, doppler: 1 };
  }
  const [ux, uy] = [dx / distance, dy / distance];
  const leftward = Math.cos(ear.yaw) * uy - Math.sin(ear.yaw) * ux;
  return {
    distance, pan: -leftward * Math.min(distance / AROUND_M, 1),
    doppler: dopplerFactor(-(source.vx * ux + source.vy * uy), ear.vx * ux + ear.vy * uy),
  };
}

/**
 * @param {number} value
 * @param {number} most
 */
function clip(value, most) {
  return Math.min(Math.max(value, -most), most);
}
