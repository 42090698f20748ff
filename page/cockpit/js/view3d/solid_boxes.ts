// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Where a camera sees a solid: the box around its picture, and its distance. */

/** Sixteen numbers, column by column, as three.js has them. */
export type Elements = ArrayLike<number>;
export type Triple = [x: number, y: number, z: number];

/** A box in space, from one corner to the opposite one in its own coordinates. */
export interface Solid {
  matrix: Elements; // from its own coordinates to those of the scene; may scale, but not shear
  low: Triple;
  high: Triple;
}

/** Shares of a picture's width and height, from its upper left corner. */
export interface Box { left: number; top: number; right: number; bottom: number }

// What is nearer to the plane of the eye is cut off [m].
const NEAR_M = 0.05;
// Pairs of corners that differ in one of x, y and z.
const EDGES = [0, 1, 2, 3, 4, 5, 6, 7].flatMap((corner) => [1, 2, 4]
  .filter((bit) => (corner & bit) === 0).map((bit) => [corner, corner | bit] as const));

/** Return the product of two matrices. */
export function product(a: Elements, b: Elements): number[] {
  return Array.from({ length: 16 }, (_, at) => [0, 1, 2, 3].reduce(
    (sum, k) => sum + a[at % 4 + 4 * k] * b[4 * Math.floor(at / 4) + k], 0));
}

/**
 * Return the box around the picture of a solid; what is behind the eye does not count.
 * @param view projection after the change to the camera's coordinates
 * @returns within 0 to 1; null where nothing of it is in the picture
 */
export function boxOf(view: Elements, { matrix, low, high }: Solid): Box | null {
  const both = product(view, matrix);
  const corners = Array.from({ length: 8 }, (_, corner) => {
    const [x, y, z] = [0, 1, 2].map((axis) => (corner & 1 << axis ? high : low)[axis]);
    return [0, 1, 3].map((row) => both[row] * x + both[4 + row] * y + both[8 + row] * z
      + both[12 + row]);
  });
  const found = { left: Infinity, top: Infinity, right: -Infinity, bottom: -Infinity };
  for (const [first, second] of EDGES) {
    for (const [x, y, w] of visibleEnds(corners[first], corners[second])) {
      found.left = Math.min(found.left, 0.5 * (1 + x / w));
      found.right = Math.max(found.right, 0.5 * (1 + x / w));
      found.top = Math.min(found.top, 0.5 * (1 - y / w));
      found.bottom = Math.max(found.bottom, 0.5 * (1 - y / w));
    }
  }
  const box = { left: Math.max(found.left, 0), top: Math.max(found.top, 0),
    right: Math.min(found.right, 1), bottom: Math.min(found.bottom, 1) };
  return box.left < box.right && box.top < box.bottom ? box : null;
}

/** Return the ends of the part of an edge that is before the eye; none if all is behind it. */
function visibleEnds(from: number[], to: number[]): number[][] {
  const [a, b] = [from, to].map((corner) => corner[2] - NEAR_M);
  if (a < 0 && b < 0) {
    return [];
  }
  const cut = () => from.map((value, i) => value + (to[i] - value) * a / (a - b));
  return [a < 0 ? cut() : from, b < 0 ? cut() : to];
}

/** Return the distance from a point to the nearest point of a solid [m]. */
export function distanceTo({ matrix, low, high }: Solid, point: Triple): number {
  const away = point.map((value, i) => value - matrix[12 + i]);
  let squares = 0;
  for (let axis = 0; axis < 3; axis += 1) {
    const column = [0, 1, 2].map((row) => matrix[4 * axis + row]);
    const scale = Math.hypot(...column);
    const along = column.reduce((sum, value, i) => sum + value * away[i], 0) / scale ** 2;
    const nearest = Math.min(Math.max(along, low[axis]), high[axis]);
    squares += ((along - nearest) * scale) ** 2;
  }
  return Math.sqrt(squares);
}

/** Return a solid that stands upright; `yaw`: heading of its x axis [rad]. */
export function upright(x: number, y: number, yaw: number, low: Triple, high: Triple): Solid {
  const [c, s] = [Math.cos(yaw), Math.sin(yaw)];
  return { matrix: [c, s, 0, 0, -s, c, 0, 0, 0, 0, 1, 0, x, y, 0, 1], low, high };
}
