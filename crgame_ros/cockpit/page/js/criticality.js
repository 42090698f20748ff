// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Criticality of the driven vehicles, step by step: time, distance and braking measures. */

import { CRITICALITY_WIDTH, MEASURES } from './frames.js';
import { countWhile } from './search.js';

/** @import { CriticalityFrame } from './frames.js' */
/** @import { Status } from './messages.js' */

/** @typedef {typeof MEASURES[number]} MeasureName */
/** @typedef {{value: number, of: number}} Critical a value, and the column of the other object */
/** @typedef {Critical & {t: number}} Worst */
/** @typedef {{ttc: number, drac: number, pet: number}} Limits */

/**
 * As in SUMO's SSM device; a live run may send others.
 *
 * @type {Limits}
 */
const USUAL = { ttc: 3, drac: 3, pet: 2 };

/** Smaller values are more critical, except of these measures. */
const GREATER = new Set(['drac']);

/** The most critical values of each vehicle over time. */
export class CriticalityLog {
  /** @type {CriticalityFrame[]} */
  #frames = [];
  #keeps_s;
  /** @type {(() => void)|null} */
  #fetch;

  /**
   * @param {number} keeps_s how far back [s]
   * @param {(() => void)|null} [fetch] requests the frames; null if they arrive by themselves
   */
  constructor(keeps_s, fetch = null) {
    this.#keeps_s = keeps_s;
    this.#fetch = fetch;
  }

  /** Request the frames, because they are shown now. */
  want() {
    const fetch = this.#fetch;
    this.#fetch = null;
    fetch?.();
  }

  /** Remove all frames. */
  clear() {
    this.#frames = [];
  }

  /** Return how many steps are stored. */
  get length() {
    return this.#frames.length;
  }

  /**
   * Add the values of a step; a repeated step replaces the stored one.
   *
   * @param {CriticalityFrame} frame
   */
  add(frame) {
    while ((this.#frames.at(-1)?.n ?? -1) >= frame.n) {
      this.#frames.pop();
    }
    this.#frames.push(frame);
    if (this.#frames[0].t < frame.t - this.#keeps_s) {
      this.#frames.shift();
    }
  }

  /**
   * Return a vehicle's values over time.
   *
   * @param {number} index of the vehicle
   * @param {MeasureName} name
   * @returns {{t: number[], values: number[]}} NaN where nothing is near
   */
  past(index, name) {
    return {
      t: this.#frames.map((frame) => frame.t),
      values: this.#frames.map((frame) => critical(frame, index, name)?.value ?? NaN),
    };
  }

  /**
   * Return a measure of a vehicle at a time.
   *
   * @param {number} t [s]
   * @param {number} index of the vehicle
   * @param {MeasureName} name
   * @returns {Critical|null} null if nothing is near, or no measurement is recent
   */
  at(t, index, name) {
    const count = countWhile(this.#frames.length, (i) => this.#frames[i].t <= t + 1e-9);
    const frame = this.#frames[count - 1];
    return frame === undefined || t - frame.t > 1 ? null : critical(frame, index, name);
  }

  /**
   * Return the most critical value until a time.
   *
   * @param {number} t [s]
   * @param {number} index of the vehicle
   * @param {MeasureName} name
   * @returns {Worst|null} null where there was none
   */
  worst(t, index, name) {
    const sense = GREATER.has(name) ? 1 : -1;
    /** @type {Worst|null} */
    let worst = null;
    for (const frame of this.#frames) {
      const found = frame.t <= t + 1e-9 ? critical(frame, index, name) : null;
      if (found !== null && (worst === null || sense * (found.value - worst.value) > 0)) {
        worst = { ...found, t: frame.t };
      }
    }
    return worst;
  }
}

/**
 * @param {CriticalityFrame} frame
 * @param {number} index of the vehicle
 * @param {MeasureName} name
 * @returns {Critical|null}
 */
function critical({ rows }, index, name) {
  for (let row = 0; row < rows.length; row += CRITICALITY_WIDTH) {
    if (rows[row] === index) {
      const place = row + 1 + 2 * MEASURES.indexOf(name);
      return rows[place + 1] < 0 ? null : { value: rows[place], of: rows[place + 1] };
    }
  }
  return null;
}

/**
 * @param {Status|null} status
 * @returns {Limits} beyond which values are critical
 */
export function limitsOf(status) {
  const [told] = Object.values(status?.criticality ?? {});
  const { ttc, drac, pet } = told?.thresholds ?? {};
  return { ttc: ttc ?? USUAL.ttc, drac: drac ?? USUAL.drac, pet: pet ?? USUAL.pet };
}
