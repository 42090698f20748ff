// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Series of measurements for plots: few points that keep the peaks. */

import type { Status } from '../messages.js';

/** Most points that are drawn of a series. */
export const MOST_POINTS = 400;

/**
 * Thin out a series: the lowest and the highest value of each time interval remain, in order.
 * Intervals begin at multiples of their length, so that the plot does not flicker while the
 * window moves.
 * @param t increasing [s]
 * @param values as many; NaN makes a gap
 * @param from first time wanted [s]
 * @param to last time wanted [s]
 * @returns at most MOST_POINTS points
 */
export function thin(t: number[], values: number[], from: number,
  to: number): { x: number[]; y: Array<number | null> } {
  const x: number[] = [];
  const y: (number | null)[] = [];
  const keep = (i: number) => {
    x.push(t[i]);
    y.push(Number.isFinite(values[i]) ? values[i] : null);
  };
  const first = t.findIndex((time) => time >= from);
  let end = t.length;
  while (end > 0 && t[end - 1] > to) {
    end -= 1;
  }
  if (first < 0) {
    return { x, y };
  }
  if (end - first <= MOST_POINTS) {
    for (let i = first; i < end; i += 1) {
      keep(i);
    }
    return { x, y };
  }
  // Two points from each interval, and one interval more where the window cuts through two.
  const stretch = (to - from) / (MOST_POINTS / 2 - 1);
  for (let i = first; i < end;) {
    const number = Math.floor(t[i] / stretch);
    let low = i;
    let high = i;
    let next = i;
    for (; next < end && Math.floor(t[next] / stretch) === number; next += 1) {
      // A comparison with NaN is false, so a number replaces NaN only by the second test.
      if (values[next] < values[low] || Number.isNaN(values[low])) {
        low = next;
      }
      if (values[next] > values[high] || Number.isNaN(values[high])) {
        high = next;
      }
    }
    keep(Math.min(low, high));
    if (low !== high) {
      keep(Math.max(low, high));
    }
    i = next;
  }
  return { x, y };
}

/**
 * Remove the jumps of a whole turn from a series of angles.
 * @param angles [rad]
 * @returns [rad], starting between -pi and pi
 */
export function unwrap(angles: number[]): number[] {
  const turn = 2 * Math.PI;
  let offset = 0;
  return angles.map((angle, i) => {
    if (i > 0 && Number.isFinite(angle - angles[i - 1])) {
      offset -= turn * Math.round((angle - angles[i - 1]) / turn);
    }
    return angle + offset;
  });
}

export interface Row {
  t: number;
  latency: Record<string, number>;
  step_error: number;
  lag: number;
  exposures: Record<string, Record<string, number | null>>;
}

function figure(timing: Status['timing'], key: string) {
  const value = timing?.[key];
  return typeof value === 'number' ? value : NaN;
}

/** Figures of the run that come with its status, over the last two minutes. */
export class HealthLog {
  #rows: Row[] = [];
  #keeps_s;

  /** @param keeps_s how far back [s] */
  constructor(keeps_s: number) {
    this.#keeps_s = keeps_s;
  }

  clear() {
    this.#rows = [];
  }

  /** @param status as the server sends it */
  add(status: Status) {
    const { t } = status;
    if (!Number.isFinite(t)) {
      return;
    }
    // A replay may go back; the later rows then arrive once more.
    while ((this.#rows.at(-1)?.t ?? -Infinity) >= t) {
      this.#rows.pop();
    }
    while (this.#rows.length > 0 && this.#rows[0].t < t - this.#keeps_s) {
      this.#rows.shift();
    }
    const latency: Record<string, number> = {};
    for (const [av, planner] of Object.entries(status.planners ?? {})) {
      latency[av] = planner.latency_ms ?? NaN;
    }
    const exposures: Row['exposures'] = {};
    for (const [vehicle, told] of Object.entries(status.criticality ?? {})) {
      exposures[vehicle] = told.exposures;
    }
    this.#rows.push({
      t, latency, exposures, step_error: figure(status.timing, 'mean_step_error_ms'),
      lag: figure(status.timing, 'final_error_ms'),
    });
  }

  /** Times of all rows [s]. */
  get t() {
    return this.#rows.map((row) => row.t);
  }

  /** Return a figure [ms]; `name`: 'step_error' or 'lag'. */
  column(name: 'step_error' | 'lag'): number[] {
    return this.#rows.map((row) => row[name]);
  }

  /** @returns its plan latency [ms] */
  latency(av: string): number[] {
    return this.#rows.map((row) => row.latency[av] ?? NaN);
  }

  /** @returns what a measure over the run had grown to */
  exposure(vehicle: string, name: string): number[] {
    return this.#rows.map((row) => row.exposures[vehicle]?.[name] ?? NaN);
  }
}
