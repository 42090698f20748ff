// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The effects of distance, direction and movement on a sound on its way to an ear. */

/** Speed of sound in air at 20 °C [m/s]. */
export const SOUND_SPEED = 343;
/** Beyond this, no other vehicle is heard [m]. */
export const RANGE_M = 100;
// Nearer than this, sounds do not get louder [m].
const NEAR_M = 2;
// A source nearer than this is no longer wholly on one side [m].
const AROUND_M = 1.5;
// A higher speed comes from a wrong state [m/s].
const MOST_SPEED = 100;

/** A point with its heading and velocity in frame map [m, rad, m/s]. */
export interface Moving { x: number; y: number; yaw: number; vx: number; vy: number }
export interface Arrival { distance: number; pan: number; doppler: number }

/**
 * Return the Doppler factor in still air: c / (c - v) for a source that approaches at v,
 * (c + v) / c for an ear that does.
 * @param source at which the source approaches the ear [m/s]
 * @param ear at which the ear approaches the source [m/s]
 * @returns heard frequency over the source's
 */
export function dopplerFactor(source: number, ear: number): number {
  return (SOUND_SPEED + clip(ear, MOST_SPEED)) / (SOUND_SPEED - clip(source, MOST_SPEED));
}

/**
 * Return the attenuation: pressure falls with 1 / distance, and fades to 0 at the range.
 * @param distance [m]
 * @returns 1 near by, 0 beyond RANGE_M
 */
export function attenuation(distance: number): number {
  const faded = 1 - (distance / RANGE_M) ** 2;
  return Math.max(faded, 0) * NEAR_M / Math.max(distance, NEAR_M);
}

/**
 * @param ear of a driver
 * @returns distance [m], pan (-1 left, 0 ahead or behind, 1 right), Doppler factor
 */
export function arrival(ear: Moving, source: Moving): Arrival {
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

function clip(value: number, most: number) {
  return Math.min(Math.max(value, -most), most);
}
