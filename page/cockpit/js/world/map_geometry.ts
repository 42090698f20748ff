// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The map as few large paths: lanelets near each other share them, and are culled together. */

import { boxOf, outlineOf } from '../outline.js';
import { collectBoundaries } from './boundaries.js';
import { strokesOf } from './marking_strokes.js';
import { addDashes, addLine, addPolygon, lengthOf, poseAlong, shifted } from './polyline.js';

import type { Box, Lanelet, Scene } from '../messages.js';
import type { Boundary } from './boundaries.js';

const CELL_M = 120;
const ARROW_EVERY_M = 32;
const SHORTEST_FOR_ARROW_M = 9;
const ZEBRA_M = 0.5;

/** Surfaces from the lowest to the highest, by their names in the palette. */
export const SURFACES = ['walk', 'parking', 'cycle', 'road', 'junction'] as const;

const PATH_OF_STROKE = {
  line: 'lines', broad: 'broad', curb: 'curbs', lowered: 'curbs', seam: 'seams',
} as const;
const SURFACE_OF_TYPE: Record<string, Surface | undefined> = {
  sidewalk: 'walk', crosswalk: 'junction', bicycleLane: 'cycle', parking: 'parking',
  shoulder: 'parking', border: 'parking', restricted: 'parking',
};

export type Surface = typeof SURFACES[number];
/** In metres around (x, y). */
export type Paths = Record<'casing' | 'seams' | 'lines' | 'broad' | 'curbs' | 'arrows' | 'zebras',
  Path2D>;

export interface Chunk extends Paths {
  x: number;
  y: number;
  box: Box;
  surfaces: Map<Surface, Path2D>;
}

/** Build the paths of a scene, each chunk relative to its own point, so that float32 suffices. */
export function buildChunks(scene: Pick<Scene, 'lanelets'>): Chunk[] {
  const chunks = new Map<string, Chunk>();
  const homes = scene.lanelets.map((lanelet) => {
    const outline = outlineOf(lanelet);
    const box = boxOf(outline);
    const key = `${Math.floor((box[0] + box[2]) / 2 / CELL_M)} `
      + `${Math.floor((box[1] + box[3]) / 2 / CELL_M)}`;
    const chunk = chunks.get(key)
      ?? emptyChunk((box[0] + box[2]) / 2, (box[1] + box[3]) / 2);
    chunks.set(key, chunk);
    addSurface(chunk, lanelet, outline);
    chunk.box = union(chunk.box, box);
    return chunk;
  });
  for (const boundary of collectBoundaries(scene.lanelets)) {
    addBoundary(homes[boundary.owner], boundary, scene.lanelets[boundary.owner]);
  }
  return [...chunks.values()];
}

function union(a: Box, b: Box): Box {
  return [Math.min(a[0], b[0]), Math.min(a[1], b[1]), Math.max(a[2], b[2]), Math.max(a[3], b[3])];
}

function emptyChunk(x: number, y: number): Chunk {
  return {
    x, y, box: [Infinity, Infinity, -Infinity, -Infinity], casing: new Path2D(),
    surfaces: new Map(), seams: new Path2D(), lines: new Path2D(), broad: new Path2D(),
    curbs: new Path2D(), arrows: new Path2D(), zebras: new Path2D(),
  };
}

export function surfaceOf(
  { types, intersection }: Pick<Lanelet, 'types' | 'intersection'>): Surface {
  const special = types.find((type) => type in SURFACE_OF_TYPE);
  return SURFACE_OF_TYPE[special ?? ''] ?? (intersection ? 'junction' : 'road');
}

function addSurface(chunk: Chunk, lanelet: Lanelet, outline: number[]) {
  const special = lanelet.types.find((type) => type in SURFACE_OF_TYPE);
  const surface = surfaceOf(lanelet);
  const path = chunk.surfaces.get(surface) ?? new Path2D();
  chunk.surfaces.set(surface, path);
  addPolygon(path, outline, chunk.x, chunk.y);
  addPolygon(chunk.casing, outline, chunk.x, chunk.y);
  if (special === 'crosswalk') {
    for (const stripe of zebraStripes(lanelet)) {
      addPolygon(chunk.zebras, stripe, chunk.x, chunk.y);
    }
  } else if (special === undefined && lanelet.one_way && !lanelet.intersection) {
    addArrows(chunk, lanelet.center);
  }
}

/**
 * Return the stripes of a crossing, along the traffic and across the path of pedestrians.
 * @returns flat polygons
 */
export function zebraStripes(lanelet: Pick<Lanelet, 'left' | 'right'>): number[][] {
  const length = Math.min(lengthOf(lanelet.left), lengthOf(lanelet.right));
  const stripes = [];
  for (let s = ZEBRA_M / 2; s + ZEBRA_M < length; s += 2 * ZEBRA_M) {
    const corners: [line: number[], at: number][] = [[lanelet.left, s],
      [lanelet.left, s + ZEBRA_M], [lanelet.right, s + ZEBRA_M], [lanelet.right, s]];
    stripes.push(corners.flatMap(([line, at]) => {
      const { x, y } = poseAlong(line, at);
      return [x, y];
    }));
  }
  return stripes;
}

function addArrows(chunk: Chunk, center: number[]) {
  const length = lengthOf(center);
  if (length < SHORTEST_FOR_ARROW_M) {
    return;
  }
  const count = Math.max(Math.round(length / ARROW_EVERY_M), 1);
  for (let i = 0; i < count; i += 1) {
    addArrow(chunk, poseAlong(center, (length * (i + 0.5)) / count));
  }
}

/** Add a slender arrow on the lane, 3.6 m long. */
function addArrow(chunk: Chunk, { x, y, yaw }: { x: number; y: number; yaw: number }) {
  const shape = [-1.8, 0.07, 0.5, 0.07, 0.5, 0.42, 1.8, 0, 0.5, -0.42, 0.5, -0.07, -1.8, -0.07];
  const cos = Math.cos(yaw);
  const sin = Math.sin(yaw);
  const placed = [];
  for (let i = 0; i < shape.length; i += 2) {
    placed.push(x + cos * shape[i] - sin * shape[i + 1], y + sin * shape[i] + cos * shape[i + 1]);
  }
  addPolygon(chunk.arrows, placed, chunk.x, chunk.y);
}

function addBoundary(chunk: Chunk, boundary: Boundary, lanelet: Lanelet) {
  for (const { kind, offset, dash } of strokesOf(boundary, lanelet)) {
    const path = chunk[PATH_OF_STROKE[kind]];
    const line = offset === 0 ? boundary.line : shifted(boundary.line, offset);
    if (dash === null) {
      addLine(path, line, chunk.x, chunk.y);
    } else {
      addDashes(path, line, chunk.x, chunk.y, ...dash);
    }
  }
}
