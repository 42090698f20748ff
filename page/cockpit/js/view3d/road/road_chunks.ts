// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Roads as a few meshes: lanelets near each other share one, and are culled together. */

import { collectBoundaries } from '../../world/boundaries.js';
import { boxOf, outlineOf } from '../../outline.js';
import { MeshParts } from './mesh_parts.js';
import { COLOR, pavementOf, RANK, reversed, RoadPaint } from './road_paint.js';

import type { Box, Lanelet, Scene } from '../../messages.js';
import type { Origin } from '../local_origin.js';
import type { Heights } from './mesh_parts.js';
import type { RoadIndex } from './road_index.js';

const LEAST_CELL_M = 150;
const MOST_CELL_M = 450;
// Chunks along the longer side of a medium-sized map.
const CELLS = 5;
const BANK_M = 2;

export type Triangulate = (ring: number[]) => ArrayLike<number>; // flat polygon to index triples

/** Build the parts of a scene's roads; `index` of its lanelets. */
export function buildRoads(scene: Scene, origin: Origin, index: RoadIndex, heights: Heights,
  triangulate: Triangulate): MeshParts[] {
  const [xmin, ymin, xmax, ymax] = scene.bounds;
  const cell = Math.min(Math.max((Math.max(xmax - xmin, ymax - ymin)) / CELLS, LEAST_CELL_M),
    MOST_CELL_M);
  const chunks = new Map<string, MeshParts>();
  const chunkOf = ([x0, y0, x1, y1]: Box): MeshParts => {
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
    const parts = homes.get(lanelet.id) as MeshParts;
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

function addPavement(parts: MeshParts, lanelet: Lanelet, heights: Heights,
  triangulate: Triangulate) {
  const [color, rank] = pavementOf(lanelet);
  const ring = outlineOf(lanelet);
  parts.addFaces(ring, lanelet.left_z && lanelet.right_z ? ladder(lanelet) : triangulate(ring),
    heights, color, rank);
}

/** Close the gap between a road and the land, which lies lower; `line`: bound of a lanelet. */
function addBank(parts: MeshParts, line: number[], isLeft: boolean, heights: Heights) {
  // Visible from outside, facing away from the road.
  const seen = isLeft ? reversed(line) : line;
  parts.addWall(seen, (x, y) => heights(x, y) - BANK_M, heights, COLOR.bank);
}

/**
 * Triangulate a lanelet from bound to bound, between points abreast, as its heights require.
 * @returns indices into its outline, which returns along the right bound
 */
export function ladder({ left, right }: Pick<Lanelet, 'left' | 'right'>): number[] {
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

/** Return each point's share of the length up to it; `line`: flat polyline. */
function sharesOf(line: number[]): number[] {
  const lengths = [0];
  for (let i = 2; i < line.length; i += 2) {
    lengths.push(lengths[lengths.length - 1]
      + Math.hypot(line[i] - line[i - 2], line[i + 1] - line[i - 1]));
  }
  const whole = lengths[lengths.length - 1] || 1;
  return lengths.map((length) => length / whole);
}
