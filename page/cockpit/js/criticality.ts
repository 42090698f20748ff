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
  // The worst of the first frames, by vehicle and measure: most calls ask for a few more.
  #worsts = new Map<string, { count: number; worst: Worst | null }>();
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

  clear() {
    this.#frames = [];
    this.#worsts.clear();
  }

  /** Return how many steps are stored. */
  get length() {
    return this.#frames.length;
  }

  /** Add the values of a step; a repeated step replaces the stored one. */
  add(frame: CriticalityFrame) {
    while ((this.#frames.at(-1)?.n ?? -1) >= frame.n) {
      this.#frames.pop();
      this.#worsts.clear();
    }
    this.#frames.push(frame);
    if (this.#frames[0].t < frame.t - this.#keeps_s) {
      this.#forget(this.#frames[0].t);
      this.#frames.shift();
    }
  }

  /** @param t of the first frame, which is dropped [s] */
  #forget(t: number) {
    for (const [key, known] of this.#worsts) {
      known.count -= 1;
      if (known.count < 0 || known.worst?.t === t) {
        this.#worsts.delete(key);
      }
    }
  }

  /** Return a vehicle's values over time: NaN where nothing is near; `index` of the vehicle. */
  past(index: number, name: string): { t: number[]; values: number[] } {
    return {
      t: this.#frames.map((frame) => frame.t),
      values: this.#frames.map((frame) => this.#critical(frame, index, name)?.value ?? NaN),
    };
  }

  /**
   * Return a measure of a vehicle at a time.
   * @param t [s]
   * @param index of the vehicle
   * @returns null if nothing is near, or no measurement is recent
   */
  at(t: number, index: number, name: string): Critical | null {
    const frame = this.#frames[this.#countUntil(t) - 1];
    return frame === undefined || t - frame.t > 1 ? null : this.#critical(frame, index, name);
  }

  /**
   * Return the most critical value until a time.
   * @param t [s]
   * @param index of the vehicle
   * @returns null where there was none
   */
  worst(t: number, index: number, name: string): Worst | null {
    const sense = this.#measures().find((each) => each.name === name)?.worst ?? -1;
    const count = this.#countUntil(t);
    const key = `${index} ${name}`;
    const known = this.#worsts.get(key);
    let { count: done, worst } = known !== undefined && known.count <= count ? known
      : { count: 0, worst: null };
    for (; done < count; done += 1) {
      const frame = this.#frames[done];
      const found = this.#critical(frame, index, name);
      if (found !== null && (worst === null || sense * (found.value - worst.value) > 0)) {
        worst = { ...found, t: frame.t };
      }
    }
    this.#worsts.set(key, { count, worst });
    return worst;
  }

  /** @returns how many frames there are until a time */
  #countUntil(t: number) {
    return countWhile(this.#frames.length, (i) => this.#frames[i].t <= t + 1e-9);
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
