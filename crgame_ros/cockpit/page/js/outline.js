// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Outlines of lanelets and boxes around points, as flat lists x0, y0, x1, y1, … [m]. */

/**
 * Give the outline of a lanelet: its left bound and back along its right one.
 *
 * @param {{left: number[], right: number[]}} lanelet with flat bounds
 * @returns {number[]} flat polygon
 */
export function outlineOf({ left, right }) {
  const outline = [...left];
  for (let i = right.length - 2; i >= 0; i -= 2) {
    outline.push(right[i], right[i + 1]);
  }
  return outline;
}

/**
 * @param {number[]} points flat
 * @returns {[number, number, number, number]} xmin, ymin, xmax, ymax
 */
export function boxOf(points) {
  /** @type {[number, number, number, number]} */
  const box = [Infinity, Infinity, -Infinity, -Infinity];
  for (let i = 0; i < points.length; i += 2) {
    box[0] = Math.min(box[0], points[i]);
    box[1] = Math.min(box[1], points[i + 1]);
    box[2] = Math.max(box[2], points[i]);
    box[3] = Math.max(box[3], points[i + 1]);
  }
  return box;
}
