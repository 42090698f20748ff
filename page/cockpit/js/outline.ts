// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Outlines of lanelets, point-in-polygon test and bounding boxes: flat lists x0, y0, … [m]. */

/**
 * Return the outline of a lanelet: its left bound, then its right one reversed.
 * @param lanelet with flat bounds
 * @returns flat polygon
 */
export function outlineOf({ left, right }: { left: number[]; right: number[] }): number[] {
  const outline = [...left];
  for (let i = right.length - 2; i >= 0; i -= 2) {
    outline.push(right[i], right[i + 1]);
  }
  return outline;
}

/** Return xmin, ymin, xmax, ymax; `points`: flat. */
export function boxOf(points: number[]): [number, number, number, number] {
  const box: [number, number, number, number] = [Infinity, Infinity, -Infinity, -Infinity];
  for (let i = 0; i < points.length; i += 2) {
    box[0] = Math.min(box[0], points[i]);
    box[1] = Math.min(box[1], points[i + 1]);
    box[2] = Math.max(box[2], points[i]);
    box[3] = Math.max(box[3], points[i + 1]);
  }
  return box;
}

/** Return whether a point is within a polygon; `ring`: flat polygon; `x` [m]; `y` [m]. */
export function contains(ring: number[], x: number, y: number) {
  let inside = false;
  for (let i = 0, j = ring.length - 2; i < ring.length; j = i, i += 2) {
    if ((ring[i + 1] > y) !== (ring[j + 1] > y)
        && x < ring[i] + (ring[j] - ring[i]) * (y - ring[i + 1]) / (ring[j + 1] - ring[i + 1])) {
      inside = !inside;
    }
  }
  return inside;
}
