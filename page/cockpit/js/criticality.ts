// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Criticality of the driven vehicles, step by step: time, distance and braking measures. */

import { countWhile } from './search.js';

import type { CriticalityFrame } from './frames.js';
import type { Measure, Status } from './messages.js';

/** A value, and the column of the other object. */
export interface Critical { value: number; of: number }
export interface Worst extends Critical { t: number }
export type Limits = Record<string, number>; // by measure

/** The most critical values of each vehicle over time. */
export class CriticalityLog {
  #frames: CriticalityFrame[] = [];
  #keeps_s;
  #fetch: (() => void) | null;

  #measures;

  /**
   * @param measures returns those of each frame, in order
   * @param keeps_s how far back [s]
   * @param fetch requests the frames; null if they arrive by themselves
   */
  constructor(measures: () => Measure[], keeps_s: number, fetch: (() => void) | null = null) {
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

  /** Add the values of a step; a repeated step replaces the stored one. */
  add(frame: CriticalityFrame) {
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
   * @param index of the vehicle
   * @returns NaN where nothing is near
   */
  past(index: number, name: string): { t: number[]; values: number[] } {
    return {
      t: this.#frames.map((frame) => frame.t),
      values: this.#frames.map((frame) => this.#critical(frame, index, name)?.value ?? NaN),
    };
  }

  /**
   * Return a measure of a vehicle at a time.
   *
   * @param t [s]
   * @param index of the vehicle
   * @returns null if nothing is near, or no measurement is recent
   */
  at(t: number, index: number, name: string): Critical | null {
    const count = countWhile(this.#frames.length, (i) => this.#frames[i].t <= t + 1e-9);
    const frame = this.#frames[count - 1];
    return frame === undefined || t - frame.t > 1 ? null : this.#critical(frame, index, name);
  }

  /**
   * Return the most critical value until a time.
   *
   * @param t [s]
   * @param index of the vehicle
   * @returns null where there was none
   */
  worst(t: number, index: number, name: string): Worst | null {
    const sense = this.#measures().find((each) => each.name === name)?.worst ?? -1;
    let worst: Worst | null = null;
    for (const frame of this.#frames) {
      const found = frame.t <= t + 1e-9 ? this.#critical(frame, index, name) : null;
      if (found !== null && (worst === null || sense * (found.value - worst.value) > 0)) {
        worst = { ...found, t: frame.t };
      }
    }
    return worst;
  }

  /** @param index of the vehicle */
  #critical({ rows, width }: CriticalityFrame, index: number, name: string): Critical | null {
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
 * @param status of a live run, which may have other limits
 * @returns beyond which values are critical
 */
export function limitsOf(measures: Measure[], status: Status | null): Limits {
  const [told] = Object.values(status?.criticality ?? {});
  const limits: Limits = {};
  for (const { name, limit } of measures) {
    if (limit !== null) {
      limits[name] = told?.thresholds[name] ?? limit;
    }
  }
  return limits;
}

/** @returns also where the two touch */
export function isCritical({ name, worst }: Measure, limits: Limits,
  value: number | undefined): boolean {
  if (value === undefined || !(name in limits)) {
    return false;
  }
  return worst > 0 ? value > limits[name] : value < limits[name] || value <= 0;
}
