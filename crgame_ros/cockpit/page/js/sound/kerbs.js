// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Kerbs of the map, and whether the wheels of one's own vehicle have just gone over one. */

import { VEHICLE, VEHICLE_WIDTH } from '../frames.js';
import { RoadIndex } from '../view3d/road/road_index.js';

/** @import { Lanelet, Scene, SceneVehicle } from '../messages.js' */
/** @import { Shown } from '../store.js' */

// How hard wheels hit each, as a share of the hardest.
/** @type {Record<string, number>} */
const STRENGTH = { curb: 1, lowered_curb: 0.35 };
// A tyre's middle from the side of its vehicle [m].
const TYRE_M = 0.1;
// What wheels can have gone since the last look: this, and twice their speed times the time [m].
const SLACK_M = 0.5;
// A kerb ends where another lanelet begins, by so much, as the driver's view has it [m].
const WITHIN_M = 0.3;

/** @typedef {[x: number, y: number]} Point */

/** Follows one vehicle over the kerbs of a scene. */
export class Kerbs {
  /** @type {RoadIndex|null} */
  #roads = null;
  /** @type {{t: number, wheels: Point[]}|null} */
  #last = null;

  /** @param {Pick<Scene, 'lanelets'>} scene */
  constructor({ lanelets }) {
    if (lanelets.some((lanelet) => kerbsOf(lanelet).length > 0)) {
      this.#roads = new RoadIndex(lanelets);
    }
  }

  /** Forget where the wheels were: what comes is another vehicle, or another time. */
  reset() {
    this.#last = null;
  }

  /**
   * Tell what the wheels have gone over since they were asked about last.
   *
   * @param {SceneVehicle} vehicle
   * @param {Shown} shown what is to be seen now
   * @param {number} index of the vehicle
   * @returns {number} how hard it is, 0 to 1; 0 for no kerb
   */
  over(vehicle, { t, vehicles }, index) {
    if (this.#roads === null) {
      return 0;
    }
    const at = index * VEHICLE_WIDTH;
    const wheels = wheelsOf(vehicle, vehicles, at);
    const before = this.#last;
    this.#last = { t, wheels };
    const most = SLACK_M + 2 * Math.abs(vehicles[at + VEHICLE.speed]) * (t - (before?.t ?? t));
    return before === null ? 0
      : Math.max(...wheels.map((to, i) => this.#crossed(before.wheels[i], to, most)));
  }

  /**
   * @param {Point} from
   * @param {Point} to
   * @param {number} most farther it was put, not driven [m]
   */
  #crossed(from, to, most) {
    const way = Math.hypot(to[0] - from[0], to[1] - from[1]);
    if (this.#roads === null || !(way > 0 && way <= most)) {
      return 0;
    }
    let hardest = 0;
    for (const { lanelet } of this.#roads.near(to[0], to[1], way)) {
      for (const { line, strength } of kerbsOf(lanelet)) {
        if (strength > hardest && crosses(line, from, to)
            && !this.#roads.isWithinAnother(to[0], to[1], lanelet, WITHIN_M)) {
          hardest = strength;
        }
      }
    }
    return hardest;
  }
}

/** @param {Lanelet} lanelet */
function kerbsOf({ left, left_line, right, right_line }) {
  return [{ line: left, strength: STRENGTH[left_line] ?? 0 },
    { line: right, strength: STRENGTH[right_line] ?? 0 }].filter(({ strength }) => strength > 0);
}

/**
 * @param {SceneVehicle} vehicle
 * @param {Float64Array} rows
 * @param {number} at where its row begins
 * @returns {Point[]} where its four wheels stand
 */
function wheelsOf({ shape, wheelbase }, rows, at) {
  const [x, y, yaw] = [VEHICLE.x, VEHICLE.y, VEHICLE.yaw].map((column) => rows[at + column]);
  const [cos, sin] = [Math.cos(yaw), Math.sin(yaw)];
  const aside = 0.5 * shape.width - TYRE_M;
  return [0, wheelbase].flatMap((ahead) => [aside, -aside].map((left) => (
    /** @type {Point} */ ([x + ahead * cos - left * sin, y + ahead * sin + left * cos]))));
}

/**
 * Return whether a way crosses a line.
 *
 * @param {number[]} line flat
 * @param {Point} from
 * @param {Point} to
 */
function crosses(line, from, to) {
  for (let i = 0; i + 3 < line.length; i += 2) {
    /** @type {[Point, Point]} */
    const [one, two] = [[line[i], line[i + 1]], [line[i + 2], line[i + 3]]];
    if (isLeft(from, to, one) !== isLeft(from, to, two)
        && isLeft(one, two, from) !== isLeft(one, two, to)) {
      return true;
    }
  }
  return false;
}

/**
 * @param {Point} from
 * @param {Point} to
 * @param {Point} point
 */
function isLeft(from, to, point) {
  return (to[0] - from[0]) * (point[1] - from[1]) > (to[1] - from[1]) * (point[0] - from[0]);
}
