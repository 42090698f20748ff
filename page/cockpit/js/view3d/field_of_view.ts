// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The field of view of a picture. */

import { DEGREE } from '../units.js';

/** Range of the angle across the picture [deg]. */
export const FIELD_OF_VIEW = { least: 30, usual: 75, most: 140 };
// At a larger angle, the roof over the driver's head would be nearer than the near plane.
const TALLEST = 95 * DEGREE;

/**
 * The driver's screen and seat, with which things appear in their true size.
 *
 * [m].
 */
export interface Seat { screen_width_m: number; eye_distance_m: number }

/**
 * Return the vertical angle of a picture from its horizontal one.
 * @param across [rad]
 * @param aspect width through height
 * @returns [rad], limited in both directions
 */
export function heightAngle(across: number, aspect: number): number {
  return Math.min(2 * Math.atan(Math.tan(across / 2) / aspect), TALLEST);
}

/**
 * Return the angle under which the driver sees a picture that is centred in front.
 * @param share of the screen's width that the picture covers
 * @returns across the picture [rad]
 */
export function trueAngle({ screen_width_m, eye_distance_m }: Seat, share: number): number {
  return 2 * Math.atan((0.5 * screen_width_m * share) / eye_distance_m);
}

/**
 * Choose the angle across a picture.
 * @param seat null for the chosen angle
 * @param chosen_deg across the picture [deg]
 * @param width of the picture [CSS px]
 * @param screenWidth of the screen [CSS px]
 * @returns [rad]
 */
export function acrossAngle(seat: Seat | null, chosen_deg: number, width: number,
  screenWidth: number): number {
  if (seat !== null) {
    return trueAngle(seat, width / screenWidth);
  }
  const { least, most } = FIELD_OF_VIEW;
  return Math.min(Math.max(chosen_deg, least), most) * DEGREE;
}

/**
 * Read the angle across the picture in a page's address.
 * @returns [deg]; null if there is none, or it is out of range
 */
export function readAngle(values: URLSearchParams): number | null {
  const angle = Number(values.get('fov') ?? NaN);
  return angle >= FIELD_OF_VIEW.least && angle <= FIELD_OF_VIEW.most ? angle : null;
}

/**
 * Read the entries about screen and seat.
 * @param width of the screen [cm]
 * @param distance of the eyes from it [cm]
 * @returns null if they are not valid
 */
export function readSeat(width: string, distance: string): Seat | null {
  const screen_width_m = Number(width) / 100;
  const eye_distance_m = Number(distance) / 100;
  return screen_width_m >= 0.05 && screen_width_m <= 20 && eye_distance_m >= 0.1
    && eye_distance_m <= 20 ? { screen_width_m, eye_distance_m } : null;
}
