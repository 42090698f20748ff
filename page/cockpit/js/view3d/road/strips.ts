// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Conversion of painted lines to strips of their width, cut into dashes. */

import { addDashes, shifted } from '../../world/polyline.js';

/** @import { Dash } from '../../world/marking_strokes.js' */

/** A path that collects the pieces of `addDashes` as flat polylines. */
class Pieces {
  /** @type {number[][]} */
  list = [];

  /**
   * @param {number} x
   * @param {number} y
   */
  moveTo(x, y) {
    this.list.push([x, y]);
  }

  /**
   * @param {number} x
   * @param {number} y
   */
  lineTo(x, y) {
    this.list[this.list.length - 1].push(x, y);
  }
}

/**
 * Return the painted pieces of a line.
 *
 * @param {number[]} line flat polyline [m]
 * @param {Dash|null} dash null for all of it
 * @returns {number[][]} flat polylines
 */
export function paintedPieces(line, dash) {
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
 *
 * @param {number[]} line flat polyline [m]
 * @param {number} width [m]
 * @returns {[left: number[], right: number[]]} its edges, flat, with as many points as the line
 */
export function stripOf(line, width) {
  return [shifted(line, width / 2), shifted(line, -width / 2)];
}
