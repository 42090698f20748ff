// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * Invented roadside objects, which are not in the map and convey the speed.
 *
 * None of them stands on a lanelet or blocks the view between roads around it. Firs and houses
 * stand beyond a line that has all of these roads on its other side, or outside of the map. Other
 * trees have no branches at the height of drivers' eyes.
 */

import { collectBoundaries } from '../../world/boundaries.js';
import { roadClass } from '../../world/marking_strokes.js';
import { lengthOf, poseAlong } from '../../world/polyline.js';
import { surfaceOf } from '../../world/map_geometry.js';
import { randomFrom } from './random.js';
import { densified } from './road_paint.js';

import type { Box, Lanelet, Scene } from '../../messages.js';
import type { RoadClass } from '../../world/marking_strokes.js';
import type { RoadIndex } from './road_index.js';

/** An object in the land: its middle in map coordinates, its direction and its size. */
export interface Stand {
  x: number;
  y: number;
  yaw: number; // away from the road, of posts and lamps along it [rad]
  size: [length: number, width: number, height: number]; // [m]
  shade: number; // 0 to 1, variation of the colour
}

export type Roadside = Record<'posts' | 'lamps' | 'trees' | 'firs' | 'houses', Stand[]>;
/** Of a road; yaw leads away from it. */
export interface EdgePose { x: number; y: number; yaw: number }

const POST_EVERY_M = 50;
const POST_BESIDE_M = 0.5;
const LAMP_EVERY_M = 32;
const LAMP_BESIDE_M = 0.9;
const TREE_EVERY_M = 8;
const HOUSE_EVERY_M = 13;
/** Within this distance, no object blocks the view between roads [m]. */
export const SIGHT_M = 60;
const SIGHT_CELL_M = 30;
const NEAREST_TREE_M = { motorway: 9, country: 4.5, town: 2.6 };
const GROUPS_AROUND = 90;
const AROUND_M = 350;
const TREE_SHARE = { motorway: 0.75, country: 0.65, town: 0.3 };

/** Points of the roads, to find those around a place. */
class RoadPoints {
  #cells = new Map<string, number[]>();

  constructor(lanelets: Lanelet[]) {
    for (const { left, right } of lanelets) {
      for (const line of [left, right]) {
        const dense = densified(line, 6);
        for (let i = 0; i < dense.length; i += 2) {
          const key = keyOf(dense[i], dense[i + 1]);
          const cell = this.#cells.get(key) ?? [];
          this.#cells.set(key, cell);
          cell.push(dense[i], dense[i + 1]);
        }
      }
    }
  }

  /**
   * Return whether every road around is on the near side of a line.
   * @param x of a point of the line
   * @param yaw normal of the line, to its far side [rad]
   */
  areBefore(x: number, y: number, yaw: number) {
    const cos = Math.cos(yaw);
    const sin = Math.sin(yaw);
    const cells = Math.ceil(SIGHT_M / SIGHT_CELL_M);
    for (let column = -cells; column <= cells; column += 1) {
      for (let row = -cells; row <= cells; row += 1) {
        const cell = this.#cells.get(
          keyOf(x + column * SIGHT_CELL_M, y + row * SIGHT_CELL_M)) ?? [];
        for (let i = 0; i < cell.length; i += 2) {
          const [dx, dy] = [cell[i] - x, cell[i + 1] - y];
          if (dx * cos + dy * sin > 0 && Math.hypot(dx, dy) < SIGHT_M) {
            return false;
          }
        }
      }
    }
    return true;
  }
}

/** A record of occupied circles. */
class Taken {
  #cells = new Map<string, { x: number; y: number; radius: number }[]>();

  /**
   * Occupy a circle, unless another one touches it.
   * @param radius at most half a cell [m]
   * @returns whether it was free
   */
  claim(x: number, y: number, radius: number): boolean {
    for (let column = -1; column <= 1; column += 1) {
      for (let row = -1; row <= 1; row += 1) {
        const cell = this.#cells.get(
          keyOf(x + column * SIGHT_CELL_M, y + row * SIGHT_CELL_M));
        if (cell?.some((other) => Math.hypot(other.x - x, other.y - y) < other.radius + radius)) {
          return false;
        }
      }
    }
    const key = keyOf(x, y);
    this.#cells.set(key, [...this.#cells.get(key) ?? [], { x, y, radius }]);
    return true;
  }
}

/** Place all objects, always alike for the same scene; `index` of its lanelets. */
export function placeRoadside({ id, bounds, lanelets }: Pick<Scene, 'id' | 'bounds' | 'lanelets'>,
  index: RoadIndex): Roadside {
  const random = randomFrom(id);
  const points = new RoadPoints(lanelets);
  const taken = new Taken();
  const stations = stationsOf(lanelets);
  const roadside: Roadside = { posts: [], lamps: [], trees: [], firs: [], houses: [] };
  for (const { line, owner, inner } of collectBoundaries(lanelets)) {
    const lanelet = lanelets[owner];
    const surface = surfaceOf(lanelet);
    if (inner || (surface !== 'road' && surface !== 'parking')) {
      continue;
    }
    const kind = roadClass(lanelet);
    const outward = line === lanelet.left ? Math.PI / 2 : -Math.PI / 2;
    const station = stations.get(lanelet.id) ?? 0;
    const edge = new Edge(line, outward, station);
    if (kind === 'town') {
      placeRow(roadside.lamps, edge, LAMP_EVERY_M, LAMP_BESIDE_M, index, taken);
      placeHouses(roadside.houses, edge, index, points, taken, random);
    } else {
      placeRow(roadside.posts, edge, POST_EVERY_M, POST_BESIDE_M, index, taken);
    }
    placeTrees(roadside, edge, kind, index, points, taken, random);
  }
  placeAround(roadside, bounds, taken, random);
  return roadside;
}

/** One side of a road. */
class Edge {
  line;
  outward;
  station;
  length;

  /**
   * @param line flat
   * @param outward from its direction [rad]
   * @param station of its start, counted along the road [m]
   */
  constructor(line: number[], outward: number, station: number) {
    this.line = line;
    this.outward = outward;
    this.station = station;
    this.length = lengthOf(line);
  }

  /** @param s along the line [m] */
  at(s: number): EdgePose {
    const { x, y, yaw } = poseAlong(this.line, s);
    return { x, y, yaw: yaw + this.outward };
  }

  /** Return the distances along the line whose station is a multiple of the spacing [m]. */
  multiples(spacing: number): number[] {
    const found = [];
    for (let s = Math.ceil(this.station / spacing) * spacing - this.station; s < this.length;
      s += spacing) {
      found.push(s);
    }
    return found;
  }
}

/**
 * Return the stations along the roads: a lanelet begins where its predecessor ends.
 * @returns station of each start, by id [m]
 */
export function stationsOf(lanelets: Lanelet[]): Map<number, number> {
  const byId = new Map(lanelets.map((lanelet) => [lanelet.id, lanelet]));
  const followers = new Set(lanelets.flatMap(({ successors }) => successors));
  const stations = new Map<number, number>();
  const begin = [...lanelets.filter(({ id }) => !followers.has(id)), ...lanelets];
  for (const first of begin) {
    const open: [Lanelet, number][] = stations.has(first.id) ? [] : [[first, 0]];
    for (let next = open.pop(); next !== undefined; next = open.pop()) {
      const [lanelet, station] = next;
      if (!stations.has(lanelet.id)) {
        stations.set(lanelet.id, station);
        const end = station + lengthOf(lanelet.center);
        for (const id of lanelet.successors) {
          const successor = byId.get(id);
          if (successor !== undefined) {
            open.push([successor, end]);
          }
        }
      }
    }
  }
  return stations;
}

/** `spacing` [m]; `beside` [m]. */
function placeRow(row: Stand[], edge: Edge, spacing: number, beside: number, index: RoadIndex,
  taken: Taken) {
  for (const s of edge.multiples(spacing)) {
    const { x, y, yaw } = beyond(edge.at(s), beside);
    if (index.isClear(x, y, 0.8 * beside) && taken.claim(x, y, 1.5)) {
      row.push({ x, y, yaw, size: [1, 1, 1], shade: 0 });
    }
  }
}

function placeTrees({ trees, firs }: Roadside, edge: Edge, kind: RoadClass, index: RoadIndex,
  points: RoadPoints, taken: Taken, random: () => number) {
  for (let s = TREE_EVERY_M * random(); s < edge.length; s += TREE_EVERY_M * (0.5 + random())) {
    const [chance, far, large, shade, type] = [random(), random(), random(), random(), random()];
    if (chance > TREE_SHARE[kind]) {
      continue;
    }
    const isFir = type < (kind === 'town' ? 0.1 : 0.45);
    const width = 3 + 3.5 * large;
    const pose = beyond(edge.at(s), NEAREST_TREE_M[kind] + width / 2 + 24 * far ** 2);
    const front = beyond(pose, -0.5);
    if (index.isClear(pose.x, pose.y, width / 2 + 0.3)
        && (!isFir || points.areBefore(front.x, front.y, front.yaw))
        && taken.claim(pose.x, pose.y, 0.35 * width)) {
      (isFir ? firs : trees).push({ ...pose, shade, size: [width, width, 6 + 5 * large] });
    }
  }
}

function placeHouses(houses: Stand[], edge: Edge, index: RoadIndex, points: RoadPoints,
  taken: Taken, random: () => number) {
  for (let s = HOUSE_EVERY_M * random(); s < edge.length; s += HOUSE_EVERY_M) {
    const [far, wide, deep, high, shade] = [random(), random(), random(), random(), random()];
    const [length, width, height] = [9 + 6 * wide, 8 + 3 * deep, 4.5 + 5 * high];
    const front = beyond(edge.at(s), 4 + 5 * far);
    const pose = beyond(front, length / 2);
    const radius = Math.hypot(length, width) / 2;
    // In a bend, its corners may be nearer to the road than the middle of its front.
    if (index.isClear(pose.x, pose.y, radius - 1) && points.areBefore(front.x, front.y, front.yaw)
        && taken.claim(pose.x, pose.y, radius)) {
      houses.push({ ...pose, shade, size: [length, width, height] });
    }
  }
}

/**
 * Place groups of trees outside of the map's box, which is convex, so that no line of sight
 * crosses them.
 * @param bounds of the map
 */
function placeAround({ trees, firs }: Roadside, [xmin, ymin, xmax, ymax]: Box, taken: Taken,
  random: () => number) {
  const [middle_x, middle_y] = [(xmin + xmax) / 2, (ymin + ymax) / 2];
  const [half_x, half_y] = [(xmax - xmin) / 2, (ymax - ymin) / 2];
  for (let group = 0; group < GROUPS_AROUND; group += 1) {
    const [turn, far, many, type] = [random(), random(), random(), random()];
    const toward = 2 * Math.PI * turn;
    const out = Math.min(half_x / Math.abs(Math.cos(toward)), half_y / Math.abs(Math.sin(toward)))
      + 30 + AROUND_M * far;
    for (let k = 0; k < 4 + 10 * many; k += 1) {
      const [dx, dy, large, shade] = [random(), random(), random(), random()];
      const x = middle_x + out * Math.cos(toward) + 46 * (dx - 0.5);
      const y = middle_y + out * Math.sin(toward) + 46 * (dy - 0.5);
      const width = 3.5 + 4 * large;
      if ((Math.abs(x - middle_x) > half_x + width || Math.abs(y - middle_y) > half_y + width)
          && taken.claim(x, y, 0.35 * width)) {
        (type < 0.5 ? firs : trees).push({ x, y, yaw: 6 * shade, shade,
          size: [width, width, 7 + 6 * large] });
      }
    }
  }
}

/** @param distance in its direction [m] */
function beyond({ x, y, yaw }: EdgePose, distance: number): EdgePose {
  return { x: x + distance * Math.cos(yaw), y: y + distance * Math.sin(yaw), yaw };
}

/** Return the name of the cell that holds a point. */
function keyOf(x: number, y: number) {
  return `${Math.floor(x / SIGHT_CELL_M)} ${Math.floor(y / SIGHT_CELL_M)}`;
}
