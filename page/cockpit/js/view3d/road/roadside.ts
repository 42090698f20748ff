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

/** @import { Box, Lanelet, Scene } from '../../messages.js' */
/** @import { RoadClass } from '../../world/marking_strokes.js' */
/** @import { RoadIndex } from './road_index.js' */

/**
 * An object in the land: its middle in map coordinates, its direction and its size.
 *
 * @typedef {object} Stand
 * @property {number} x
 * @property {number} y
 * @property {number} yaw away from the road, of posts and lamps along it [rad]
 * @property {[length: number, width: number, height: number]} size [m]
 * @property {number} shade 0 to 1, variation of the colour
 */

/** @typedef {Record<'posts'|'lamps'|'trees'|'firs'|'houses', Stand[]>} Roadside */
/** @typedef {{x: number, y: number, yaw: number}} EdgePose of a road; yaw leads away from it */

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
  /** @type {Map<string, number[]>} */
  #cells = new Map();

  /** @param {Lanelet[]} lanelets */
  constructor(lanelets) {
    for (const { left, right } of lanelets) {
      for (const line of [left, right]) {
        const dense = densified(line, 6);
        for (let i = 0; i < dense.length; i += 2) {
          const key = keyOf(dense[i], dense[i + 1], SIGHT_CELL_M);
          const cell = this.#cells.get(key) ?? [];
          this.#cells.set(key, cell);
          cell.push(dense[i], dense[i + 1]);
        }
      }
    }
  }

  /**
   * Return whether every road around is on the near side of a line.
   *
   * @param {number} x of a point of the line
   * @param {number} y
   * @param {number} yaw normal of the line, to its far side [rad]
   */
  areBefore(x, y, yaw) {
    const cos = Math.cos(yaw);
    const sin = Math.sin(yaw);
    const cells = Math.ceil(SIGHT_M / SIGHT_CELL_M);
    for (let column = -cells; column <= cells; column += 1) {
      for (let row = -cells; row <= cells; row += 1) {
        const cell = this.#cells.get(keyOf(x + column * SIGHT_CELL_M, y + row * SIGHT_CELL_M,
          SIGHT_CELL_M)) ?? [];
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
  /** @type {Map<string, {x: number, y: number, radius: number}[]>} */
  #cells = new Map();

  /**
   * Occupy a circle, unless another one touches it.
   *
   * @param {number} x
   * @param {number} y
   * @param {number} radius at most half a cell [m]
   * @returns {boolean} whether it was free
   */
  claim(x, y, radius) {
    for (let column = -1; column <= 1; column += 1) {
      for (let row = -1; row <= 1; row += 1) {
        const cell = this.#cells.get(
          keyOf(x + column * SIGHT_CELL_M, y + row * SIGHT_CELL_M, SIGHT_CELL_M));
        if (cell?.some((other) => Math.hypot(other.x - x, other.y - y) < other.radius + radius)) {
          return false;
        }
      }
    }
    const key = keyOf(x, y, SIGHT_CELL_M);
    this.#cells.set(key, [...this.#cells.get(key) ?? [], { x, y, radius }]);
    return true;
  }
}

/**
 * Place all objects, always alike for the same scene.
 *
 * @param {Pick<Scene, 'id'|'bounds'|'lanelets'>} scene the scene document
 * @param {RoadIndex} index of its lanelets
 * @returns {Roadside}
 */
export function placeRoadside({ id, bounds, lanelets }, index) {
  const random = randomFrom(id);
  const points = new RoadPoints(lanelets);
  const taken = new Taken();
  const stations = stationsOf(lanelets);
  /** @type {Roadside} */
  const roadside = { posts: [], lamps: [], trees: [], firs: [], houses: [] };
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
  /**
   * @param {number[]} line flat
   * @param {number} outward from its direction [rad]
   * @param {number} station of its start, counted along the road [m]
   */
  constructor(line, outward, station) {
    this.line = line;
    this.outward = outward;
    this.station = station;
    this.length = lengthOf(line);
  }

  /**
   * @param {number} s along the line [m]
   * @returns {EdgePose}
   */
  at(s) {
    const { x, y, yaw } = poseAlong(this.line, s);
    return { x, y, yaw: yaw + this.outward };
  }

  /**
   * @param {number} spacing [m]
   * @returns {number[]} distances along the line whose station is a multiple of the spacing
   */
  multiples(spacing) {
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
 *
 * @param {Lanelet[]} lanelets
 * @returns {Map<number, number>} station of each start, by id [m]
 */
export function stationsOf(lanelets) {
  const byId = new Map(lanelets.map((lanelet) => [lanelet.id, lanelet]));
  const followers = new Set(lanelets.flatMap(({ successors }) => successors));
  /** @type {Map<number, number>} */
  const stations = new Map();
  const begin = [...lanelets.filter(({ id }) => !followers.has(id)), ...lanelets];
  for (const first of begin) {
    /** @type {[Lanelet, number][]} */
    const open = stations.has(first.id) ? [] : [[first, 0]];
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

/**
 * @param {Stand[]} row
 * @param {Edge} edge
 * @param {number} spacing [m]
 * @param {number} beside [m]
 * @param {RoadIndex} index
 * @param {Taken} taken
 */
function placeRow(row, edge, spacing, beside, index, taken) {
  for (const s of edge.multiples(spacing)) {
    const { x, y, yaw } = beyond(edge.at(s), beside);
    if (index.isClear(x, y, 0.8 * beside) && taken.claim(x, y, 1.5)) {
      row.push({ x, y, yaw, size: [1, 1, 1], shade: 0 });
    }
  }
}

/**
 * @param {Roadside} roadside
 * @param {Edge} edge
 * @param {RoadClass} kind
 * @param {RoadIndex} index
 * @param {RoadPoints} points
 * @param {Taken} taken
 * @param {() => number} random
 */
function placeTrees({ trees, firs }, edge, kind, index, points, taken, random) {
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

/**
 * @param {Stand[]} houses
 * @param {Edge} edge
 * @param {RoadIndex} index
 * @param {RoadPoints} points
 * @param {Taken} taken
 * @param {() => number} random
 */
function placeHouses(houses, edge, index, points, taken, random) {
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
 *
 * @param {Roadside} roadside
 * @param {Box} bounds of the map
 * @param {Taken} taken
 * @param {() => number} random
 */
function placeAround({ trees, firs }, [xmin, ymin, xmax, ymax], taken, random) {
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

/**
 * @param {EdgePose} pose
 * @param {number} distance in its direction [m]
 * @returns {EdgePose}
 */
function beyond({ x, y, yaw }, distance) {
  return { x: x + distance * Math.cos(yaw), y: y + distance * Math.sin(yaw), yaw };
}

/**
 * @param {number} x
 * @param {number} y
 * @param {number} cell [m]
 */
function keyOf(x, y, cell) {
  return `${Math.floor(x / cell)} ${Math.floor(y / cell)}`;
}
