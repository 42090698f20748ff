// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Conversion of painted lines to strips of their width, cut into dashes. */

import { addDashes, shifted } from '../../world/polyline.js';

import type { Dash } from '../../world/marking_strokes.js';

/** A path that collects the pieces of `addDashes` as flat polylines. */
class Pieces {
  list: number[][] = [];

  moveTo(x: number, y: number) {
    this.list.push([x, y]);
  }

  lineTo(x: number, y: number) {
    this.list[this.list.length - 1].push(x, y);
  }
}

/**
 * Return the painted pieces of a line.
 * @param line flat polyline [m]
 * @param dash null for all of it
 * @returns flat polylines
 */
export function paintedPieces(line: number[], dash: Dash | null): number[][] {
  if (dash === null) {
    return [line];
  }
  const pieces = new Pieces();
  addDashes(pieces, line, 0, 0, ...dash);
  // If a line ends with a gap, the last dash has only one point.
  return pieces.list.filter((piece) => piece.length > 2);
}

/**
 * Widen a line to a strip.
 * @param line flat polyline [m]
 * @param width [m]
 * @returns its edges, flat, with as many points as the line
 */
export function stripOf(line: number[], width: number): [left: number[], right: number[]] {
  return [shifted(line, width / 2), shifted(line, -width / 2)];
}
