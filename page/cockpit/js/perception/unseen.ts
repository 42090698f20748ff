// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The present objects that an AV's planner has not been told of. */

import { OBJECT_WIDTH, VEHICLE_WIDTH } from '../frames.js';

/** @import { Scene } from '../messages.js' */

/** The seen and unseen objects of one AV, for one scene; its arrays are refilled. */
export class Unseen {
  #scene;
  #flags;

  /** @param {Scene} scene the scene document */
  constructor(scene) {
    this.#scene = scene;
    this.#flags = new Uint8Array(scene.vehicles.length + scene.objects.length);
  }

  /**
   * @param {string|null} id of a vehicle
   * @returns {number} its index if it is an AV with perception, else -1
   */
  perceiving(id) {
    return this.#scene.vehicles.findIndex((item) => item.id === id && item.perception);
  }

  /**
   * Mark the objects that are not seen, whether present or not.
   *
   * @param {number} av index of the AV
   * @param {Float64Array} columns of the seen objects
   * @returns {Uint8Array} 1 for each vehicle, then object, that is not seen
   */
  flags(av, columns) {
    this.#flags.fill(1);
    this.#flags[av] = 0;
    for (const column of columns) {
      this.#flags[column] = 0;
    }
    return this.#flags;
  }

  /**
   * Return how many objects are within an AV's sensor range, and how many of them are seen.
   *
   * @param {number} av index of the AV
   * @param {Float64Array} columns of the seen objects
   * @param {{vehicles: Float64Array, objects: Float64Array}} shown of Store.displayed
   * @returns {{seen: number, near: number, range: number|null}} range [m], null for no limit
   */
  count(av, columns, { vehicles, objects }) {
    const range = this.#scene.vehicles[av].perception?.range ?? null;
    const flags = this.flags(av, columns);
    const x = vehicles[av * VEHICLE_WIDTH];
    const y = vehicles[av * VEHICLE_WIDTH + 1];
    const total = { seen: 0, near: 0, range };
    /** @type {(otherX: number, otherY: number, column: number) => void} */
    const add = (otherX, otherY, column) => {
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

/**
 * Return a count in words.
 *
 * @param {{seen: number, near: number, range: number|null}} count of `Unseen.count`
 * @returns {string} sees 3 of 4 within 80 m
 */
export function countText({ seen, near, range }) {
  return `sees ${seen} of ${near}${range === null ? '' : ` within ${Math.round(range)} m`}`;
}
