// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The state of brake lights, from the pedal or from the deceleration. */

import { OBJECT_WIDTH, VEHICLE } from '../frames.js';

/** @import { ObjectsFrame } from '../frames.js' */

const BRAKE_PEDAL = 0.02;
// Without a known pedal: the deceleration by which brake lights go on [m/s^2].
const BRAKE_DECELERATION = 0.7;
const STANDING = 0.1;

/** The brake lights of a scene. */
export class BrakeLights {
  #objects = new Uint8Array(0);
  /** @type {Pick<ObjectsFrame, 'k'|'t'|'objects'>|null} */
  #lastStep = null;

  /** @param {number} count of objects in the scene */
  load(count) {
    this.#objects = new Uint8Array(count);
    this.#lastStep = null;
  }

  /**
   * Update from a scenario step which objects slow down.
   *
   * @param {Pick<ObjectsFrame, 'k'|'t'|'objects'>} step as received by the store
   */
  update(step) {
    const last = this.#lastStep;
    this.#lastStep = step;
    if (last === null || step.k <= last.k || last.objects.length !== step.objects.length) {
      return;
    }
    for (let i = 0; i < this.#objects.length; i += 1) {
      const speed = speedOf(step.objects, i);
      const slower = (speedOf(last.objects, i) - speed) / (step.t - last.t);
      this.#objects[i] = slower > BRAKE_DECELERATION && speed > STANDING ? 1 : 0;
    }
  }

  /**
   * @param {number} index of an object
   * @returns {boolean} whether its brake lights are on
   */
  ofObject(index) {
    return this.#objects[index] === 1;
  }

  /**
   * @param {Float64Array} rows of a STATE frame
   * @param {number} row where the driven vehicle's begins
   * @returns {boolean} whether its brake lights are on
   */
  ofVehicle(rows, row) {
    const pedal = rows[row + VEHICLE.brake];
    if (!Number.isNaN(pedal)) {
      return pedal > BRAKE_PEDAL;
    }
    const speed = rows[row + VEHICLE.speed];
    return rows[row + VEHICLE.acceleration] * Math.sign(speed) < -BRAKE_DECELERATION
      && Math.abs(speed) > STANDING;
  }
}

/**
 * @param {Float64Array} rows
 * @param {number} index
 */
function speedOf(rows, index) {
  return Math.hypot(rows[index * OBJECT_WIDTH + 3], rows[index * OBJECT_WIDTH + 4]);
}
