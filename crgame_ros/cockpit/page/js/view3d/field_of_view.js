// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** How much of the world a picture shows. */

const DEGREE = Math.PI / 180;
/** What can be chosen across the picture [deg]. */
export const FIELD_OF_VIEW = { least: 30, usual: 75, most: 140 };
// Taller, the roof over the driver's head would be nearer than what is drawn.
const TALLEST = 95 * DEGREE;

/**
 * What the driver says of screen and seat: then things are as large as in reality.
 *
 * @typedef {{screen_width_m: number, eye_distance_m: number}} Seat [m]
 */

/**
 * Return the angle that a picture has in height when it has one in width.
 *
 * @param {number} across [rad]
 * @param {number} aspect width through height
 * @returns {number} [rad], so that neither side is more than a picture can bear
 */
export function heightAngle(across, aspect) {
  return Math.min(2 * Math.atan(Math.tan(across / 2) / aspect), TALLEST);
}

/**
 * Return the angle under which the driver sees the picture on the screen, its middle in front.
 *
 * @param {Seat} seat
 * @param {number} share of the screen's width that the picture has
 * @returns {number} across the picture [rad]
 */
export function trueAngle({ screen_width_m, eye_distance_m }, share) {
  return 2 * Math.atan((0.5 * screen_width_m * share) / eye_distance_m);
}

/**
 * Choose the angle across a picture.
 *
 * @param {Seat|null} seat null for the chosen angle
 * @param {number} chosen_deg across the picture [deg]
 * @param {number} width of the picture [CSS px]
 * @param {number} screenWidth of the screen [CSS px]
 * @returns {number} [rad]
 */
export function acrossAngle(seat, chosen_deg, width, screenWidth) {
  if (seat !== null) {
    return trueAngle(seat, width / screenWidth);
  }
  const { least, most } = FIELD_OF_VIEW;
  return Math.min(Math.max(chosen_deg, least), most) * DEGREE;
}

/**
 * Read what somebody says of screen and seat.
 *
 * @param {string} width of the screen [cm]
 * @param {string} distance of the eyes from it [cm]
 * @returns {Seat|null} null if that is no screen
 */
export function readSeat(width, distance) {
  const screen_width_m = Number(width) / 100;
  const eye_distance_m = Number(distance) / 100;
  return screen_width_m >= 0.05 && screen_width_m <= 20 && eye_distance_m >= 0.1
    && eye_distance_m <= 20 ? { screen_width_m, eye_distance_m } : null;
}
