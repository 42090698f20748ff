// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The present objects that an AV's planner has not been told of. */

import { OBJECT_WIDTH, VEHICLE_WIDTH } from '../frames.js';

import type { Scene } from '../messages.js';

/** The seen and unseen objects of one AV, for one scene; its arrays are refilled. */
export class Unseen {
  #scene;
  #flags;

  constructor(scene: Scene) {
    this.#scene = scene;
    this.#flags = new Uint8Array(scene.vehicles.length + scene.objects.length);
  }

  /** Return a vehicle's index if it is an AV with perception, else -1. */
  perceiving(id: string | null): number {
    return this.#scene.vehicles.findIndex((item) => item.id === id && item.perception);
  }

  /**
   * Mark the objects that are not seen, whether present or not.
   * @param av index of the AV
   * @param columns of the seen objects
   * @returns 1 for each vehicle, then object, that is not seen
   */
  flags(av: number, columns: Float64Array): Uint8Array {
    this.#flags.fill(1);
    this.#flags[av] = 0;
    for (const column of columns) {
      this.#flags[column] = 0;
    }
    return this.#flags;
  }

  /**
   * Return how many objects are within an AV's sensor range, and how many of them are seen.
   * @param av index of the AV
   * @param columns of the seen objects
   * @param shown of Store.displayed
   * @returns range [m], null for no limit
   */
  count(av: number, columns: Float64Array,
    { vehicles, objects }: { vehicles: Float64Array; objects: Float64Array }): { seen: number;
    near: number; range: number | null } {
    const range = this.#scene.vehicles[av].perception?.range ?? null;
    const flags = this.flags(av, columns);
    const x = vehicles[av * VEHICLE_WIDTH];
    const y = vehicles[av * VEHICLE_WIDTH + 1];
    const total = { seen: 0, near: 0, range };
    const add = (otherX: number, otherY: number, column: number) => {
      // False for NaN: an absent object is not near.
      if (column !== av && Math.hypot(otherX - x, otherY - y) <= (range ?? Infinity)) {
        total.near += 1;
        total.seen += 1 - flags[column];
      }
    };
    const driven = this.#scene.vehicles.length;
    for (let i = 0; i < driven; i += 1) {
      add(vehicles[i * VEHICLE_WIDTH], vehicles[i * VEHICLE_WIDTH + 1], i);
    }
    for (let i = 0; i * OBJECT_WIDTH < objects.length; i += 1) {
      add(objects[i * OBJECT_WIDTH], objects[i * OBJECT_WIDTH + 1], driven + i);
    }
    return total;
  }
}

/** Return a count in words: sees 3 of 4 within 80 m; `count` of `Unseen.count`. */
export function countText(
  { seen, near, range }: { seen: number; near: number; range: number | null }): string {
  return `sees ${seen} of ${near}${range === null ? '' : ` within ${Math.round(range)} m`}`;
}
