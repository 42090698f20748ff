// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The speed limit where a vehicle is, from the lanelets of the scene. */

import { boxOf, contains, outlineOf } from '../outline.js';

import type { Box, FiredEvent, Scene } from '../messages.js';

export interface Lane {
  id: number;
  limit: number | null;
  usual: number | null;
  center: number[];
  one_way: boolean;
  ring: number[];
  box: Box;
}

/** A lookup of the speed limit under a point. */
export class SpeedLimits {
  #lanes: Lane[] = [];
  #scene;

  constructor(scene: Scene | null) {
    this.#scene = scene;
    for (const lanelet of scene?.lanelets ?? []) {
      this.#lanes.push({
        id: lanelet.id, limit: lanelet.speed_limit ?? null, usual: lanelet.speed_limit ?? null,
        center: lanelet.center, one_way: lanelet.one_way,
        ring: outlineOf(lanelet), box: boxOf([...lanelet.left, ...lanelet.right]),
      });
    }
  }

  /** Apply the limits of fired events, the latest last. */
  applyEvents(fired: FiredEvent[]) {
    for (const lane of this.#lanes) {
      lane.limit = lane.usual;
    }
    for (const { name } of fired) {
      const event = this.#scene?.events?.find((entry) => entry.name === name);
      if (event?.kind === 'speed_limit') {
        const all = event.lanelets.length === 0;
        this.#lanes.filter(({ id }) => all || event.lanelets.includes(id)).forEach((lane) => {
          lane.limit = event.speed;
        });
      }
    }
  }

  /**
   * Return the limit of the lane under a vehicle; at a crossing, of the lane that fits its
   * heading.
   * @param x of the vehicle [m]
   * @param y of the vehicle [m]
   * @param yaw of the vehicle [rad]
   * @returns [m/s], null if none is known
   */
  at(x: number, y: number, yaw: number): number | null {
    let best = null;
    let bestAlong = -Infinity;
    for (const lane of this.#lanes) {
      const [x0, y0, x1, y1] = lane.box;
      if (x >= x0 && x <= x1 && y >= y0 && y <= y1 && contains(lane.ring, x, y)) {
        const cosine = Math.cos(yaw - headingNear(lane.center, x, y));
        const along = lane.one_way === false ? Math.abs(cosine) : cosine;
        if (along > bestAlong) {
          [best, bestAlong] = [lane, along];
        }
      }
    }
    return best?.limit ?? null;
  }
}

function headingNear(center: number[], x: number, y: number) {
  let nearest = 0;
  let least = Infinity;
  for (let i = 0; i + 3 < center.length; i += 2) {
    const distance = Math.hypot((center[i] + center[i + 2]) / 2 - x,
      (center[i + 1] + center[i + 3]) / 2 - y);
    if (distance < least) {
      [nearest, least] = [i, distance];
    }
  }
  return Math.atan2(center[nearest + 3] - center[nearest + 1],
    center[nearest + 2] - center[nearest]);
}
