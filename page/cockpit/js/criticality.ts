// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Criticality of the driven vehicles, step by step: time, distance and braking measures. */

import { countWhile } from './search.js';

/** @import { CriticalityFrame } from './frames.js' */
/** @import { Measure, Status } from './messages.js' */

/** @typedef {{value: number, of: number}} Critical a value, and the column of the other object */
/** @typedef {Critical & {t: number}} Worst */
/** @typedef {Record<string, number>} Limits by measure */

/** The most critical values of each vehicle over time. */
export class CriticalityLog {
  /** @type {CriticalityFrame[]} */
  #frames = [];
  #keeps_s;
  /** @type {(() => void)|null} */
  #fetch;

  #measures;

  /**
   * @param {() => Measure[]} measures returns those of each frame, in order
   * @param {number} keeps_s how far back [s]
   * @param {(() => void)|null} [fetch] requests the frames; null if they arrive by themselves
   */
  constructor(measures, keeps_s, fetch = null) {
    this.#measures = measures;
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
   * @param {string} name
   * @returns {{t: number[], values: number[]}} NaN where nothing is near
   */
  past(index, name) {
    return {
      t: this.#frames.map((frame) => frame.t),
      values: this.#frames.map((frame) => this.#critical(frame, index, name)?.value ?? NaN),
    };
  }

  /**
   * Return a measure of a vehicle at a time.
   *
   * @param {number} t [s]
   * @param {number} index of the vehicle
   * @param {string} name
   * @returns {Critical|null} null if nothing is near, or no measurement is recent
   */
  at(t, index, name) {
    const count = countWhile(this.#frames.length, (i) => this.#frames[i].t <= t + 1e-9);
    const frame = this.#frames[count - 1];
    return frame === undefined || t - frame.t > 1 ? null : this.#critical(frame, index, name);
  }

  /**
   * Return the most critical value until a time.
   *
   * @param {number} t [s]
   * @param {number} index of the vehicle
   * @param {string} name
   * @returns {Worst|null} null where there was none
   */
  worst(t, index, name) {
    const sense = this.#measures().find((each) => each.name === name)?.worst ?? -1;
    /** @type {Worst|null} */
    let worst = null;
    for (const frame of this.#frames) {
      const found = frame.t <= t + 1e-9 ? this.#critical(frame, index, name) : null;
      if (found !== null && (worst === null || sense * (found.value - worst.value) > 0)) {
        worst = { ...found, t: frame.t };
      }
    }
    return worst;
  }

  /**
   * @param {CriticalityFrame} frame
   * @param {number} index of the vehicle
   * @param {string} name
   * @returns {Critical|null}
   */
  #critical({ rows, width }, index, name) {
    const place = this.#measures().findIndex((each) => each.name === name);
    for (let row = 0; row < rows.length; row += width) {
      if (place >= 0 && rows[row] === index) {
        const column = 1 + 2 * place;
        const [value, of] = rows.subarray(row + column, row + column + 2);
        return of < 0 ? null : { value, of };
      }
    }
    return null;
  }
}

/**
 * @param {Measure[]} measures
 * @param {Status|null} status of a live run, which may have other limits
 * @returns {Limits} beyond which values are critical
 */
export function limitsOf(measures, status) {
  const [told] = Object.values(status?.criticality ?? {});
  /** @type {Limits} */
  const limits = {};
  for (const { name, limit } of measures) {
    if (limit !== null) {
      limits[name] = told?.thresholds[name] ?? limit;
    }
  }
  return limits;
}

/**
 * @param {Measure} measure
 * @param {Limits} limits
 * @param {number|undefined} value
 * @returns {boolean} also where the two touch
 */
export function isCritical({ name, worst }, limits, value) {
  if (value === undefined || !(name in limits)) {
    return false;
  }
  return worst > 0 ? value > limits[name] : value < limits[name] || value <= 0;
}
