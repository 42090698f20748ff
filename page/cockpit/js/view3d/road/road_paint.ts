// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The pavement of roads, by the types of their lanelets, and their painted markings. */

import { surfaceOf, zebraStripes } from '../../world/map_geometry.js';
import { strokesOf } from '../../world/marking_strokes.js';
import { shifted } from '../../world/polyline.js';
import { paintedPieces, stripOf } from './strips.js';

import type { Lanelet, Scene } from '../../messages.js';
import type { Boundary } from '../../world/boundaries.js';
import type { Stroke } from '../../world/marking_strokes.js';
import type { Heights, MeshParts, Rgb } from './mesh_parts.js';
import type { RoadIndex } from './road_index.js';

/** Ranks of flat things: the higher one is on top. */
export const RANK = { road: 1, special: 2, seam: 3, line: 4, across: 5 };

export const COLOR: Record<'road' | 'walk' | 'cycle' | 'parking' | 'bus' | 'kerb' | 'seam'
  | 'white' | 'yellow' | 'worn' | 'bank', Rgb> = {
  road: [98, 100, 103], walk: [172, 167, 157], cycle: [139, 84, 72], parking: [112, 111, 110],
  bus: [108, 93, 82], kerb: [178, 176, 170], seam: [66, 67, 70], white: [240, 240, 236],
  yellow: [232, 186, 60], worn: [158, 159, 158], bank: [96, 104, 70],
};
const KERB_M = { curb: 0.12, lowered: 0.03 };
const STOP_LINE_M = 0.5;
const WAIT_LINE_M = 0.3;
const WAIT_DASH: [number, number] = [0.5, 0.25];
// Countries with a yellow centre line.
const YELLOW_CENTRES = ['USA', 'PRI', 'CAN', 'MEX', 'BRA', 'ARG', 'CHN'];
// A kerb, or an edge of unknown marking, ends where another lanelet begins.
const STEP_M = 1.5;
const WITHIN_M = 0.3;

/** Return the pavement of a lanelet and its rank. */
export function pavementOf(
  lanelet: Pick<Lanelet, 'types' | 'intersection'>): [color: Rgb, rank: number] {
  if (lanelet.types.includes('busLane')) {
    return [COLOR.bus, RANK.special];
  }
  const surface = surfaceOf(lanelet);
  if (surface === 'walk' || surface === 'cycle'
      || (surface === 'parking' && !lanelet.types.includes('shoulder'))) {
    return [COLOR[surface], RANK.special];
  }
  return [COLOR.road, RANK.road];
}

/** A painter of a scene's boundaries and of markings across its lanes. */
export class RoadPaint {
  #index;
  #heights;
  #yellow;

  /** @param index of its lanelets */
  constructor({ country }: Pick<Scene, 'country'>, index: RoadIndex, heights: Heights) {
    this.#index = index;
    this.#heights = heights;
    this.#yellow = YELLOW_CENTRES.includes(country);
  }

  /** Add the paint or kerb along a boundary; `lanelet` whose boundary it is. */
  addBoundary(parts: MeshParts, boundary: Boundary, lanelet: Lanelet) {
    for (const stroke of strokesOf(boundary, lanelet)) {
      const line = shifted(boundary.line, stroke.offset);
      if (stroke.kind === 'curb' || stroke.kind === 'lowered') {
        this.#addKerb(parts, line, stroke, KERB_M[stroke.kind], lanelet);
      } else if (stroke.kind !== 'seam') {
        const color = this.#yellow && isCentre(boundary, lanelet) ? COLOR.yellow : COLOR.white;
        this.#addStrips(parts, paintedPieces(line, stroke.dash), stroke.width, color, RANK.line);
      } else if (boundary.marking !== 'unknown') {
        this.#addStrips(parts, [line], stroke.width, COLOR.seam, RANK.seam);
      }
    }
    // An unknown marking becomes a worn line: without any line, a driver could not keep the lane.
    if (boundary.marking === 'unknown' && !lanelet.intersection) {
      this.#addWorn(parts, boundary, lanelet);
    }
  }

  /** @param lanelet a crossing */
  addZebra(parts: MeshParts, lanelet: Lanelet) {
    for (const stripe of zebraStripes(lanelet)) {
      parts.addFaces(stripe, [0, 2, 1, 0, 3, 2], this.#heights, COLOR.white, RANK.across);
    }
  }

  addStopLine(parts: MeshParts, { points, line }: { points: number[]; line: string }) {
    const dashed = line.includes('dashed');
    this.#addStrips(parts, paintedPieces(points, dashed ? WAIT_DASH : null),
      dashed ? WAIT_LINE_M : STOP_LINE_M, COLOR.white, RANK.across);
  }

  #addWorn(parts: MeshParts, boundary: Boundary, lanelet: Lanelet) {
    const known = { ...boundary, marking: boundary.inner ? 'dashed' : 'solid' };
    for (const { width, dash } of strokesOf(known, lanelet)) {
      for (const piece of this.#freePieces(boundary.line, lanelet)) {
        this.#addStrips(parts, paintedPieces(piece, dash), width, COLOR.worn, RANK.seam);
      }
    }
  }

  #addKerb(parts: MeshParts, line: number[], { width }: Stroke, height: number, lanelet: Lanelet) {
    const top: Heights = (x, y) => this.#heights(x, y) + height;
    for (const piece of this.#freePieces(line, lanelet)) {
      const [left, right] = stripOf(piece, width);
      parts.addStrip(left, right, top, COLOR.kerb, 0);
      parts.addWall(right, this.#heights, top, COLOR.kerb);
      parts.addWall(reversed(left), this.#heights, top, COLOR.kerb);
    }
  }

  #addStrips(parts: MeshParts, pieces: number[][], width: number, color: Rgb, rank: number) {
    for (const piece of pieces) {
      const [left, right] = stripOf(piece, width);
      parts.addStrip(left, right, this.#heights, color, rank);
    }
  }

  /** Return the pieces of a line that do not lead through other lanelets. */
  #freePieces(line: number[], lanelet: Lanelet): number[][] {
    const pieces: number[][] = [];
    let piece: number[] = [];
    const dense = densified(line, STEP_M);
    for (let i = 0; i < dense.length; i += 2) {
      if (this.#index.isWithinAnother(dense[i], dense[i + 1], lanelet, WITHIN_M)) {
        pieces.push(piece);
        piece = [];
      } else {
        piece.push(dense[i], dense[i + 1]);
      }
    }
    return [...pieces, piece].filter(({ length }) => length > 2).map(straightened);
  }
}

/** Return whether a boundary separates two directions. */
function isCentre({ line }: Boundary, lanelet: Lanelet) {
  return line === lanelet.left ? lanelet.adj_left !== null && !lanelet.adj_left_same
    : lanelet.adj_right !== null && !lanelet.adj_right_same;
}

/**
 * @param line flat polyline
 * @param step longest part of the result [m]
 * @returns the same line, with points between its own
 */
export function densified(line: number[], step: number): number[] {
  const dense = line.slice(0, 2);
  for (let i = 2; i < line.length; i += 2) {
    const [x, y] = [line[i - 2], line[i - 1]];
    const count = Math.max(Math.ceil(Math.hypot(line[i] - x, line[i + 1] - y) / step), 1);
    for (let k = 1; k <= count; k += 1) {
      dense.push(x + (k / count) * (line[i] - x), y + (k / count) * (line[i + 1] - y));
    }
  }
  return dense;
}

/**
 * Return a line without the points that lie straight between their neighbours.
 * @param line flat polyline
 */
function straightened(line: number[]): number[] {
  const kept = line.slice(0, 2);
  for (let i = 2; i + 3 < line.length; i += 2) {
    const ax = line[i] - kept[kept.length - 2];
    const ay = line[i + 1] - kept[kept.length - 1];
    const bx = line[i + 2] - line[i];
    const by = line[i + 3] - line[i + 1];
    if (Math.abs(ax * by - ay * bx) > 1e-6 * Math.hypot(ax, ay) * Math.hypot(bx, by)) {
      kept.push(line[i], line[i + 1]);
    }
  }
  kept.push(...line.slice(-2));
  return kept;
}

/** Return a flat polyline in reverse order. */
export function reversed(line: number[]): number[] {
  const back = [];
  for (let i = line.length - 2; i >= 0; i -= 2) {
    back.push(line[i], line[i + 1]);
  }
  return back;
}
