// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The state of brake lights, from the pedal or from the deceleration. */

import { OBJECT_WIDTH, VEHICLE } from '../frames.js';

import type { ObjectsFrame } from '../frames.js';

const BRAKE_PEDAL = 0.02;
// Without a known pedal: the deceleration by which brake lights go on [m/s^2].
const BRAKE_DECELERATION = 0.7;
const STANDING = 0.1;

/** The brake lights of a scene. */
export class BrakeLights {
  #objects = new Uint8Array(0);
  #lastStep: Pick<ObjectsFrame, 'k' | 't' | 'objects'> | null = null;

  /** @param count of objects in the scene */
  load(count: number) {
    this.#objects = new Uint8Array(count);
    this.#lastStep = null;
  }

  /** Update from a scenario step which objects slow down; `step` as received by the store. */
  update(step: Pick<ObjectsFrame, 'k' | 't' | 'objects'>) {
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

  /** Return whether an object's brake lights are on. */
  ofObject(index: number): boolean {
    return this.#objects[index] === 1;
  }

  /**
   * @param rows of a STATE frame
   * @param row where the driven vehicle's begins
   * @returns whether its brake lights are on
   */
  ofVehicle(rows: Float64Array, row: number): boolean {
    const pedal = rows[row + VEHICLE.brake];
    if (!Number.isNaN(pedal)) {
      return pedal > BRAKE_PEDAL;
    }
    const speed = rows[row + VEHICLE.speed];
    return rows[row + VEHICLE.acceleration] * Math.sign(speed) < -BRAKE_DECELERATION
      && Math.abs(speed) > STANDING;
  }
}

function speedOf(rows: Float64Array, index: number) {
  return Math.hypot(rows[index * OBJECT_WIDTH + 3], rows[index * OBJECT_WIDTH + 4]);
}
