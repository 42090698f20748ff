// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The land around the roads: flat, or below every road of a map with heights. */

import { MeshParts } from './mesh_parts.js';
import { randomFrom } from './random.js';

import type { Scene } from '../../messages.js';
import type { Origin } from '../local_origin.js';
import type { Heights, Rgb } from './mesh_parts.js';

// How far the land continues beyond the map [m].
const MARGIN_M = 1200;
const MOST_CELLS = 72;
const LEAST_CELL_M = 15;
// Tiles along an edge.
const TILES = 4;
const BELOW_M = 0.04;
// Depth below roads on hills, which the land's triangles follow only roughly [m].
const UNDER_HILLS_M = 0.4;
const MEADOW: Rgb = [104, 124, 78];
const FIELD: Rgb = [140, 138, 94];
// Rank under everything else that is flat.
const RANK = -2;

/**
 * Build the land of a scene in tiles, of which a picture draws the visible ones.
 * @returns the same tiles with few triangles, none where the land is not flat, and its height at
 *   points within it [m]
 */
export function buildLand(scene: Scene,
  origin: Origin): { tiles: MeshParts[]; plain: MeshParts[]; heightAt: Heights } {
  const [xmin, ymin, xmax, ymax] = scene.bounds;
  const size = Math.max(xmax - xmin, ymax - ymin) + 2 * MARGIN_M;
  const cell = Math.max(size / MOST_CELLS, LEAST_CELL_M);
  const count = Math.ceil(size / cell);
  const x0 = (xmin + xmax - count * cell) / 2;
  const y0 = (ymin + ymax - count * cell) / 2;
  const heights = landHeights(scene, x0, y0, cell, count);
  const random = randomFrom(scene.id);
  const shares = Float64Array.from({ length: (count + 1) ** 2 }, random);
  const corner: Corner = (parts, row, column) => {
    const at = row * (count + 1) + column;
    const color = MEADOW.map(
      (value, i) => value + 0.55 * shares[at] * (FIELD[i] - value)) as Rgb;
    return parts.vertex(x0 + column * cell, y0 + row * cell,
      heights === null ? -BELOW_M : heights[at], color, RANK);
  };
  const tiles: MeshParts[] = [];
  const plain: MeshParts[] = [];
  const edge = Math.ceil(count / TILES);
  for (let row = 0; row < count; row += edge) {
    for (let column = 0; column < count; column += edge) {
      const rows = rangeOf(row, Math.min(row + edge, count));
      const columns = rangeOf(column, Math.min(column + edge, count));
      tiles.push(buildTile(new MeshParts(origin), corner, rows, columns));
      if (heights === null) {
        plain.push(buildTile(new MeshParts(origin), corner, everyFourth(rows),
          everyFourth(columns)));
      }
    }
  }
  return { tiles, plain, heightAt: (x, y) => {
    const column = Math.min(Math.max(Math.round((x - x0) / cell), 0), count);
    const row = Math.min(Math.max(Math.round((y - y0) / cell), 0), count);
    return heights === null ? 0 : heights[row * (count + 1) + column];
  } };
}

/** Adds one of the land's corners, and returns its index. */
export type Corner = (parts: MeshParts, row: number, column: number) => number;

/** @returns both and all numbers between them */
function rangeOf(first: number, last: number): number[] {
  return Array.from({ length: last - first + 1 }, (_, i) => first + i);
}

/** @returns every fourth of it, and the last */
function everyFourth(range: number[]): number[] {
  return range.filter((_, i) => i % 4 === 0 || i === range.length - 1);
}

/** Fill empty `parts` and return them; `rows` of corners. */
function buildTile(parts: MeshParts, corner: Corner, rows: number[],
  columns: number[]): MeshParts {
  for (const [i, row] of rows.entries()) {
    for (const [k, column] of columns.entries()) {
      const last = corner(parts, row, column);
      if (i > 0 && k > 0) {
        const below = last - columns.length;
        parts.indices.push(below - 1, below, last, below - 1, last, last - 1);
      }
    }
  }
  return parts;
}

/**
 * Compute the heights of the land under the roads: each corner is under the lowest road of the
 * cells around it, or, without one, as high as the corners around it.
 * @param cell [m]
 * @param count of cells along an edge
 * @returns by row and column [m]; null for a flat map
 */
function landHeights(scene: Scene, x0: number, y0: number, cell: number,
  count: number): Float64Array | null {
  const width = count + 1;
  const lowest = new Float64Array(width * width).fill(Infinity);
  for (const { left, right, left_z, right_z } of scene.lanelets) {
    for (const [line, heights] of [[left, left_z], [right, right_z]] as const) {
      if (!heights) {
        continue;
      }
      for (let i = 0; i + 3 < line.length; i += 2) {
        const steps = Math.ceil(Math.hypot(line[i + 2] - line[i], line[i + 3] - line[i + 1])
          / cell) + 1;
        for (let k = 0; k <= steps; k += 1) {
          const share = k / steps;
          const column = Math.floor((line[i] + share * (line[i + 2] - line[i]) - x0) / cell);
          const row = Math.floor((line[i + 1] + share * (line[i + 3] - line[i + 1]) - y0) / cell);
          lower(lowest, width, row, column,
            heights[i / 2] + share * (heights[i / 2 + 1] - heights[i / 2]) - UNDER_HILLS_M);
        }
      }
    }
  }
  return lowest.every((height) => height === Infinity) ? null : spread(lowest, width);
}

function lower(lowest: Float64Array, width: number, row: number, column: number, height: number) {
  for (let r = Math.max(row - 1, 0); r <= Math.min(row + 2, width - 1); r += 1) {
    for (let c = Math.max(column - 1, 0); c <= Math.min(column + 2, width - 1); c += 1) {
      lowest[r * width + c] = Math.min(lowest[r * width + c], height);
    }
  }
}

/** Fill unknown heights from their neighbours, ring by ring; `heights`: Infinity if unknown. */
function spread(heights: Float64Array, width: number): Float64Array {
  let unknown = [...heights.keys()].filter((i) => heights[i] === Infinity);
  while (unknown.length > 0) {
    const known = heights.slice();
    unknown = unknown.filter((i) => {
      const column = i % width;
      const around = [i - width, i + width, column > 0 ? i - 1 : -1,
        column < width - 1 ? i + 1 : -1].filter((j) => known[j] !== undefined
          && known[j] !== Infinity);
      if (around.length > 0) {
        heights[i] = around.reduce((sum, j) => sum + known[j], 0) / around.length;
      }
      return around.length === 0;
    });
  }
  return heights;
}
