// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A spatial index of a scene's roads, for roadside objects and for heights. */

import { boxOf, contains, outlineOf } from '../../outline.js';

/** @import { Box, Lanelet } from '../../messages.js' */

const CELL_M = 25;
// Tolerance, because a bound's own points are on the road, too [m].
const ON_M = 0.05;
// How far beside a road its height applies [m].
const BESIDE_M = 60;

/** @typedef {{lanelet: Lanelet, ring: number[], box: Box}} Place */

/** An index of lanelets by place. */
export class RoadIndex {
  /** @type {Map<number, Map<number, Place[]>>} */
  #rows = new Map();

  /** @param {Lanelet[]} lanelets */
  constructor(lanelets) {
    /** Whether the map has heights; else it is flat. */
    this.hasHeights = lanelets.some(({ left_z }) => Boolean(left_z));
    for (const lanelet of lanelets) {
      const ring = outlineOf(lanelet);
      const place = { lanelet, ring, box: boxOf(ring) };
      this.#eachCell(place.box, (column, row) => {
        const cells = this.#rows.get(row) ?? new Map();
        this.#rows.set(row, cells);
        cells.set(column, [...cells.get(column) ?? [], place]);
      });
    }
  }

  /**
   * Return the lanelets whose box is within a distance of a point.
   *
   * @param {number} x
   * @param {number} y
   * @param {number} reach [m]
   * @returns {Set<Place>}
   */
  near(x, y, reach) {
    /** @type {Set<Place>} */
    const found = new Set();
    this.#eachCell([x - reach, y - reach, x + reach, y + reach], (column, row) => {
      for (const place of this.#rows.get(row)?.get(column) ?? []) {
        const [xmin, ymin, xmax, ymax] = place.box;
        if (x >= xmin - reach && x <= xmax + reach && y >= ymin - reach && y <= ymax + reach) {
          found.add(place);
        }
      }
    });
    return found;
  }

  /**
   * Return whether a circle touches no lanelet.
   *
   * @param {number} x of its centre
   * @param {number} y of its centre
   * @param {number} radius [m]
   */
  isClear(x, y, radius) {
    for (const { ring } of this.near(x, y, radius)) {
      if (contains(ring, x, y) || distanceToRing(ring, x, y) < radius) {
        return false;
      }
    }
    return true;
  }

  /**
   * Return whether a point lies well within a lanelet that is neither this one nor beside it.
   *
   * @param {number} x
   * @param {number} y
   * @param {Lanelet} own
   * @param {number} depth least distance to the other's outline [m]
   */
  isWithinAnother(x, y, own, depth) {
    for (const { lanelet: { id }, ring } of this.near(x, y, 0)) {
      if (id !== own.id && id !== own.adj_left && id !== own.adj_right
          && contains(ring, x, y) && distanceToRing(ring, x, y) > depth) {
        return true;
      }
    }
    return false;
  }

  /**
   * Return the height of the road: of the highest bridge at a crossing, beside it of the nearest.
   *
   * @param {number} x
   * @param {number} y
   * @returns {number} [m], 0 on a flat map, and far from every road
   */
  heightAt(x, y) {
    if (!this.hasHeights) {
      return 0;
    }
    let highest = -Infinity;
    for (const { lanelet, ring } of this.near(x, y, ON_M)) {
      if (contains(ring, x, y) || distanceToRing(ring, x, y) < ON_M) {
        highest = Math.max(highest, heightOn(lanelet, x, y));
      }
    }
    return highest === -Infinity ? this.#heightBeside(x, y) : highest;
  }

  /**
   * @param {number} x
   * @param {number} y
   */
  #heightBeside(x, y) {
    let least = Infinity;
    let height = 0;
    for (const { lanelet, ring } of this.near(x, y, BESIDE_M)) {
      const distance = distanceToRing(ring, x, y);
      if (distance < least) {
        least = distance;
        height = heightOn(lanelet, x, y);
      }
    }
    return height;
  }

  /**
   * @param {Box} box
   * @param {(column: number, row: number) => void} visit
   */
  #eachCell([xmin, ymin, xmax, ymax], visit) {
    for (let row = Math.floor(ymin / CELL_M); row <= Math.floor(ymax / CELL_M); row += 1) {
      for (let column = Math.floor(xmin / CELL_M); column <= Math.floor(xmax / CELL_M);
        column += 1) {
        visit(column, row);
      }
    }
  }
}

/**
 * Return a lanelet's height at a point, interpolated between both bounds.
 *
 * @param {Lanelet} lanelet
 * @param {number} x
 * @param {number} y
 * @returns {number} [m]
 */
export function heightOn({ left, right, left_z, right_z }, x, y) {
  if (!left_z || !right_z) {
    return 0;
  }
  const [to_left, left_height] = beside(left, left_z, x, y);
  const [to_right, right_height] = beside(right, right_z, x, y);
  const width = to_left + to_right;
  return width === 0 ? left_height : (left_height * to_right + right_height * to_left) / width;
}

/**
 * @param {number[]} line
 * @param {number[]} heights
 * @param {number} x
 * @param {number} y
 * @returns {[distance: number, height: number]} of its nearest point
 */
function beside(line, heights, x, y) {
  let least = Infinity;
  let height = 0;
  for (let i = 0; i + 3 < line.length; i += 2) {
    const [distance, share] = toSegment(line, i, i + 2, x, y);
    if (distance < least) {
      least = distance;
      height = heights[i / 2] + share * (heights[i / 2 + 1] - heights[i / 2]);
    }
  }
  return [least, height];
}

/**
 * @param {number[]} ring flat polygon
 * @param {number} x
 * @param {number} y
 */
function distanceToRing(ring, x, y) {
  let least = Infinity;
  for (let i = 0, j = ring.length - 2; i < ring.length; j = i, i += 2) {
    least = Math.min(least, toSegment(ring, j, i, x, y)[0]);
  }
  return least;
}

/**
 * @param {number[]} line flat
 * @param {number} i where the segment's start is in it
 * @param {number} j where its end is
 * @param {number} x
 * @param {number} y
 * @returns {[distance: number, share: number]} of the nearest point, from its start
 */
function toSegment(line, i, j, x, y) {
  const dx = line[j] - line[i];
  const dy = line[j + 1] - line[i + 1];
  const square = dx * dx + dy * dy;
  const along = square === 0 ? 0 : ((x - line[i]) * dx + (y - line[i + 1]) * dy) / square;
  const share = Math.min(Math.max(along, 0), 1);
  return [Math.hypot(line[i] + share * dx - x, line[i + 1] + share * dy - y), share];
}
