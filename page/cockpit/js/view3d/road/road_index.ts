// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A spatial index of a scene's roads, for roadside objects and for heights. */

import { boxOf, contains, outlineOf } from '../../outline.js';

import type { Box, Lanelet } from '../../messages.js';

const CELL_M = 25;
// Tolerance, because a bound's own points are on the road, too [m].
const ON_M = 0.05;
// How far beside a road its height applies [m].
const BESIDE_M = 60;

export interface Place { lanelet: Lanelet; ring: number[]; box: Box }

/** An index of lanelets by place. */
export class RoadIndex {
  #rows = new Map<number, Map<number, Place[]>>();
  /** Whether the map has heights; else it is flat. */
  hasHeights;

  constructor(lanelets: Lanelet[]) {
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

  /** Return the lanelets whose box is within a distance of a point; `reach` [m]. */
  near(x: number, y: number, reach: number): Set<Place> {
    const found = new Set<Place>();
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
   * @param x of its centre
   * @param y of its centre
   * @param radius [m]
   */
  isClear(x: number, y: number, radius: number) {
    for (const { ring } of this.near(x, y, radius)) {
      if (contains(ring, x, y) || distanceToRing(ring, x, y) < radius) {
        return false;
      }
    }
    return true;
  }

  /**
   * Return whether a point lies well within a lanelet that is neither this one nor beside it.
   * @param depth least distance to the other's outline [m]
   */
  isWithinAnother(x: number, y: number, own: Lanelet, depth: number) {
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
   * @returns [m], 0 on a flat map, and far from every road
   */
  heightAt(x: number, y: number): number {
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

  #heightBeside(x: number, y: number) {
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

  #eachCell([xmin, ymin, xmax, ymax]: Box, visit: (column: number, row: number) => void) {
    for (let row = Math.floor(ymin / CELL_M); row <= Math.floor(ymax / CELL_M); row += 1) {
      for (let column = Math.floor(xmin / CELL_M); column <= Math.floor(xmax / CELL_M);
        column += 1) {
        visit(column, row);
      }
    }
  }
}

/** Return a lanelet's height at a point [m], interpolated between both bounds. */
export function heightOn({ left, right, left_z, right_z }: Lanelet, x: number, y: number): number {
  if (!left_z || !right_z) {
    return 0;
  }
  const [to_left, left_height] = beside(left, left_z, x, y);
  const [to_right, right_height] = beside(right, right_z, x, y);
  const width = to_left + to_right;
  return width === 0 ? left_height : (left_height * to_right + right_height * to_left) / width;
}

/** @returns of its nearest point */
function beside(line: number[], heights: number[], x: number,
  y: number): [distance: number, height: number] {
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

/** @param ring flat polygon */
function distanceToRing(ring: number[], x: number, y: number) {
  let least = Infinity;
  for (let i = 0, j = ring.length - 2; i < ring.length; j = i, i += 2) {
    least = Math.min(least, toSegment(ring, j, i, x, y)[0]);
  }
  return least;
}

/**
 * @param line flat
 * @param i where the segment's start is in it
 * @param j where its end is
 * @returns of the nearest point, from its start
 */
function toSegment(line: number[], i: number, j: number, x: number,
  y: number): [distance: number, share: number] {
  const dx = line[j] - line[i];
  const dy = line[j + 1] - line[i + 1];
  const square = dx * dx + dy * dy;
  const along = square === 0 ? 0 : ((x - line[i]) * dx + (y - line[i + 1]) * dy) / square;
  const share = Math.min(Math.max(along, 0), 1);
  return [Math.hypot(line[i] + share * dx - x, line[i + 1] + share * dy - y), share];
}
