// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Roads as a few meshes: lanelets near each other share one, and are culled together. */

import { collectBoundaries } from '../../world/boundaries.js';
import { boxOf, outlineOf } from '../../outline.js';
import { MeshParts } from './mesh_parts.js';
import { COLOR, pavementOf, RANK, reversed, RoadPaint } from './road_paint.js';

/** @import { Box, Lanelet, Scene } from '../../messages.js' */
/** @import { Origin } from '../local_origin.js' */
/** @import { Heights } from './mesh_parts.js' */
/** @import { RoadIndex } from './road_index.js' */

const LEAST_CELL_M = 150;
const MOST_CELL_M = 450;
// Chunks along the longer side of a medium-sized map.
const CELLS = 5;
const BANK_M = 2;

/** @typedef {(ring: number[]) => ArrayLike<number>} Triangulate flat polygon to index triples */

/**
 * Build the parts of a scene's roads.
 *
 * @param {Scene} scene the scene document
 * @param {Origin} origin
 * @param {RoadIndex} index of its lanelets
 * @param {Heights} heights
 * @param {Triangulate} triangulate
 * @returns {MeshParts[]}
 */
export function buildRoads(scene, origin, index, heights, triangulate) {
  const [xmin, ymin, xmax, ymax] = scene.bounds;
  const cell = Math.min(Math.max((Math.max(xmax - xmin, ymax - ymin)) / CELLS, LEAST_CELL_M),
    MOST_CELL_M);
  /** @type {Map<string, MeshParts>} */
  const chunks = new Map();
  /** @type {(box: Box) => MeshParts} */
  const chunkOf = ([x0, y0, x1, y1]) => {
    const key = `${Math.floor((x0 + x1) / 2 / cell)} ${Math.floor((y0 + y1) / 2 / cell)}`;
    const chunk = chunks.get(key) ?? new MeshParts(origin);
    chunks.set(key, chunk);
    return chunk;
  };
  const paint = new RoadPaint(scene, index, heights);
  const homes = new Map(scene.lanelets.map((lanelet) => {
    const parts = chunkOf(boxOf(outlineOf(lanelet)));
    addPavement(parts, lanelet, heights, triangulate);
    if (lanelet.types.includes('crosswalk')) {
      paint.addZebra(parts, lanelet);
    }
    return [lanelet.id, parts];
  }));
  for (const gap of scene.gaps ?? []) {
    chunkOf(boxOf(gap)).addFaces(gap, triangulate(gap), heights, COLOR.road, RANK.road);
  }
  for (const boundary of collectBoundaries(scene.lanelets)) {
    const lanelet = scene.lanelets[boundary.owner];
    const parts = /** @type {MeshParts} */ (homes.get(lanelet.id));
    paint.addBoundary(parts, boundary, lanelet);
    if (index.hasHeights && !boundary.inner) {
      addBank(parts, boundary.line, boundary.line === lanelet.left, heights);
    }
  }
  for (const stop of scene.stop_lines) {
    paint.addStopLine(chunkOf(boxOf(stop.points)), stop);
  }
  return [...chunks.values()].filter(({ triangles }) => triangles > 0);
}

/**
 * @param {MeshParts} parts
 * @param {Lanelet} lanelet
 * @param {Heights} heights
 * @param {Triangulate} triangulate
 */
function addPavement(parts, lanelet, heights, triangulate) {
  const [color, rank] = pavementOf(lanelet);
  const ring = outlineOf(lanelet);
  parts.addFaces(ring, lanelet.left_z && lanelet.right_z ? ladder(lanelet) : triangulate(ring),
    heights, color, rank);
}

/**
 * Close the gap between a road and the land, which lies lower.
 *
 * @param {MeshParts} parts
 * @param {number[]} line bound of a lanelet
 * @param {boolean} isLeft
 * @param {Heights} heights
 */
function addBank(parts, line, isLeft, heights) {
  // Visible from outside, facing away from the road.
  const seen = isLeft ? reversed(line) : line;
  parts.addWall(seen, (x, y) => heights(x, y) - BANK_M, heights, COLOR.bank);
}

/**
 * Triangulate a lanelet from bound to bound, between points abreast, as its heights require.
 *
 * @param {Pick<Lanelet, 'left'|'right'>} lanelet
 * @returns {number[]} indices into its outline, which returns along the right bound
 */
export function ladder({ left, right }) {
  const [there, back] = [sharesOf(left), sharesOf(right)];
  const last = there.length + back.length - 1;
  const faces = [];
  let [i, j] = [0, 0];
  while (i < there.length - 1 || j < back.length - 1) {
    if (j === back.length - 1 || (i < there.length - 1 && there[i + 1] <= back[j + 1])) {
      faces.push(i, last - j, i + 1);
      i += 1;
    } else {
      faces.push(i, last - j, last - j - 1);
      j += 1;
    }
  }
  return faces;
}

/**
 * @param {number[]} line flat polyline
 * @returns {number[]} of each point the share of the length up to it
 */
function sharesOf(line) {
  const lengths = [0];
  for (let i = 2; i < line.length; i += 2) {
    lengths.push(lengths[lengths.length - 1]
      + Math.hypot(line[i] - line[i - 2], line[i + 1] - line[i - 1]));
  }
  const whole = lengths[lengths.length - 1] || 1;
  return lengths.map((length) => length / whole);
}
