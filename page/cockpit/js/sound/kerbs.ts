// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Kerbs of the map, and detection of wheels of the own vehicle that cross one. */

import { VEHICLE, VEHICLE_WIDTH } from '../frames.js';
import { RoadIndex } from '../view3d/road/road_index.js';

import type { Lanelet, Scene, SceneVehicle } from '../messages.js';
import type { Shown } from '../store.js';

// Strength of the impact on each kind of kerb, as a share of the hardest.
const STRENGTH: Record<string, number> = { curb: 1, lowered_curb: 0.35 };
// Distance of a tyre's middle from the side of its vehicle [m].
const TYRE_M = 0.1;
// Longest way of wheels since the last call: this plus twice their speed times the time [m].
const SLACK_M = 0.5;
// A kerb ends this far before another lanelet, as in the driver's view [m].
const WITHIN_M = 0.3;

export type Point = [x: number, y: number];

/** A detector of kerbs that one vehicle crosses. */
export class Kerbs {
  #roads: RoadIndex | null = null;
  #last: { t: number; wheels: Point[] } | null = null;

  constructor({ lanelets }: Pick<Scene, 'lanelets'>) {
    if (lanelets.some((lanelet) => kerbsOf(lanelet).length > 0)) {
      this.#roads = new RoadIndex(lanelets);
    }
  }

  /** Clear the wheels' positions, for another vehicle or another time. */
  reset() {
    this.#last = null;
  }

  /**
   * Return the strongest kerb that the wheels have crossed since the last call.
   * @param shown current rows
   * @param index of the vehicle
   * @returns how hard it is, 0 to 1; 0 for no kerb
   */
  over(vehicle: SceneVehicle, { t, vehicles }: Shown, index: number): number {
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

  /** @param most longest way; beyond it the vehicle was moved, not driven [m] */
  #crossed(from: Point, to: Point, most: number) {
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

function kerbsOf({ left, left_line, right, right_line }: Lanelet) {
  return [{ line: left, strength: STRENGTH[left_line] ?? 0 },
    { line: right, strength: STRENGTH[right_line] ?? 0 }].filter(({ strength }) => strength > 0);
}

/** Return where its four wheels stand; `at`: where its row begins. */
function wheelsOf({ shape, wheelbase }: SceneVehicle, rows: Float64Array, at: number): Point[] {
  const [x, y, yaw] = [VEHICLE.x, VEHICLE.y, VEHICLE.yaw].map((column) => rows[at + column]);
  const [cos, sin] = [Math.cos(yaw), Math.sin(yaw)];
  const aside = 0.5 * shape.width - TYRE_M;
  return [0, wheelbase].flatMap((ahead) => [aside, -aside].map((left) => (
    [x + ahead * cos - left * sin, y + ahead * sin + left * cos])));
}

/** Return whether a way crosses a line; `line`: flat. */
function crosses(line: number[], from: Point, to: Point) {
  for (let i = 0; i + 3 < line.length; i += 2) {
    const [one, two]: [Point, Point] = [[line[i], line[i + 1]], [line[i + 2], line[i + 3]]];
    if (isLeft(from, to, one) !== isLeft(from, to, two)
        && isLeft(one, two, from) !== isLeft(one, two, to)) {
      return true;
    }
  }
  return false;
}

function isLeft(from: Point, to: Point, point: Point) {
  return (to[0] - from[0]) * (point[1] - from[1]) > (to[1] - from[1]) * (point[0] - from[0]);
}
