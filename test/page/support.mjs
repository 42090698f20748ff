// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Shared helpers of the page's tests: compare numbers, write frames, record paths. */

import assert from 'node:assert/strict';

/**
 * Compare numbers, or lists of them.
 *
 * @param {number|ArrayLike<number>} actual
 * @param {number|ArrayLike<number>} expected NaN equals NaN
 * @param {number} [tolerance] largest difference
 */
export function close(actual, expected, tolerance = 1e-9) {
  const [found, wanted] = [actual, expected].map(
    (value) => (typeof value === 'number' ? [value] : Array.from(value)));
  assert.equal(found.length, wanted.length, `${found} is not as long as ${wanted}`);
  found.forEach((value, i) => {
    const same = Object.is(value, wanted[i]) || Math.abs(value - wanted[i]) <= tolerance;
    assert.ok(same, `[${i}] ${value} is not ${wanted[i]} within ${tolerance}`);
  });
}

/**
 * Write a frame as the server does: little-endian Float64 values.
 *
 * @param {...number} values
 * @returns {ArrayBuffer}
 */
export function frameOf(...values) {
  const view = new DataView(new ArrayBuffer(8 * values.length));
  values.forEach((value, i) => view.setFloat64(8 * i, value, true));
  return view.buffer;
}

/**
 * Write a STATE frame.
 *
 * @param {{epoch?: number, n: number, k?: number, t: number}} head
 * @param {...number[]} rows of 13 values; missing values are 0
 * @returns {ArrayBuffer}
 */
export function stateFrame({ epoch = 0, n, k = 0, t }, ...rows) {
  return frameOf(1, epoch, n, k, t, rows.length,
    ...rows.flatMap((row) => Array.from({ length: 13 }, (_, i) => row[i] ?? 0)));
}

/** Stands for Path2D: keeps the drawing as straight pieces and their bounding points. */
export class PathRecorder {
  /** Each piece is a list of points [x, y]. */
  pieces = [];
  closed = 0;
  arcs = [];

  moveTo(x, y) {
    this.pieces.push([[x, y]]);
  }

  lineTo(x, y) {
    if (this.pieces.length === 0) {
      this.pieces.push([]);
    }
    this.pieces.at(-1).push([x, y]);
  }

  // A curve stays within its control points.
  quadraticCurveTo(cx, cy, x, y) {
    this.lineTo(cx, cy);
    this.lineTo(x, y);
  }

  closePath() {
    this.closed += 1;
  }

  rect(x, y, width, height) {
    this.pieces.push([[x, y], [x + width, y], [x + width, y + height], [x, y + height]]);
    this.closed += 1;
  }

  roundRect(x, y, width, height) {
    this.rect(x, y, width, height);
  }

  ellipse(x, y, rx, ry) {
    this.arcs.push({ x, y, rx, ry });
    this.pieces.push([[x - rx, y], [x + rx, y], [x, y - ry], [x, y + ry]]);
  }

  arc(x, y, radius) {
    this.ellipse(x, y, radius, radius);
  }

  addPath(other) {
    this.pieces.push(...other.pieces);
  }

  /** Return the length of each drawn piece. */
  get lengths() {
    return this.pieces.filter((piece) => piece.length > 1).map((piece) => piece.slice(1).reduce(
      (sum, [x, y], i) => sum + Math.hypot(x - piece[i][0], y - piece[i][1]), 0));
  }

  /** Return xmin, ymin, xmax, ymax of all points. */
  get box() {
    const points = this.pieces.flat();
    const [xs, ys] = [points.map(([x]) => x), points.map(([, y]) => y)];
    return [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
  }
}

/** Make modules that draw loadable without a browser. */
export function recordPaths() {
  globalThis.Path2D = PathRecorder;
}

/**
 * Give the page a storage of its own.
 *
 * @param {Record<string, string>} [content] its initial content
 * @returns {Map<string, string>} the stored items
 */
export function keepStorage(content = {}) {
  const kept = new Map(Object.entries(content));
  const storage = {
    getItem: (key) => kept.get(key) ?? null,
    setItem: (key, value) => kept.set(key, String(value)),
    removeItem: (key) => kept.delete(key),
  };
  globalThis.localStorage = storage;
  globalThis.window = Object.assign(globalThis.window ?? {}, { localStorage: storage });
  return kept;
}

/**
 * Make a straight lanelet along x, by default 4 m wide around y = 0.
 *
 * @param {object} [more] changed properties
 * @returns {object} lanelet as in a scene
 */
export function laneletOf({ id = 1, length = 100, y = 0, width = 4, ...more } = {}) {
  return {
    id, left: [0, y + width / 2, length, y + width / 2],
    right: [0, y - width / 2, length, y - width / 2], center: [0, y, length, y], types: ['urban'],
    left_line: 'solid', right_line: 'dashed', one_way: true, speed_limit: 13.89,
    intersection: false, adj_left: null, adj_left_same: false, adj_right: null,
    adj_right_same: false, successors: [], ...more,
  };
}
