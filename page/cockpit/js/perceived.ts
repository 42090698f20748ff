// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The requested perception of AVs, and the map of permanent obstacles. */

import { KIND } from './frames.js';
import { turn } from './interpolation.js';
import { SampleRing } from './samples.js';

import type {
  EstimateFrame, OccupancyFrame, PerceptionFrame, ScanFrame, SeenFrame,
} from './frames.js';

// 3 s at the 30 Hz of a live run, 1 s at the 100 Hz of a recording.
const ESTIMATES = 100;
// A planner gets a request 10 times a second: after this time its knowledge is out of date [s].
const SEEN_LASTS_S = 1;
// Age up to which an estimate is extrapolated; an older one is not used [s].
const ESTIMATE_LASTS_S = 0.5;
// A scan stays for so many of its sensor's periods, and a little longer [s].
const SCAN_PERIODS = 2;
const SCAN_LASTS_S = 0.3;
// Frames may be ahead of the shown time by the delay of the display [s].
const AHEAD_S = 0.5;

/** Of the rear axle; `n` of the estimate. */
export type ShownEstimate = Pick<EstimateFrame, 'n' | 'x' | 'y' | 'yaw' | 'xx' | 'xy' | 'yy'>;

/** Frames of perception by AV, and the newest map. */
export class Perceived {
  /** {x, y, resolution, rows, columns, bits} of the permanent obstacles, null for none. */
  occupancy: OccupancyFrame | null = null;
  #seen = new Map<number, SeenFrame>();
  #estimates = new Map<number, SampleRing<EstimateFrame>>();
  #scans = new Map<string, ScanFrame>();

  /** Add a frame of one of these kinds; `frame`: decoded frame. */
  add(frame: PerceptionFrame) {
    switch (frame.kind) {
      case KIND.SEEN: this.#seen.set(frame.index, frame); break;
      case KIND.SCAN: this.#scans.set(`${frame.index}:${frame.sensor}`, frame); break;
      case KIND.OCCUPANCY: this.occupancy = frame; break;
      case KIND.ESTIMATE: {
        const ring = this.#estimates.get(frame.index) ?? new SampleRing(ESTIMATES);
        this.#estimates.set(frame.index, ring);
        ring.push(frame);
        break;
      }
      default:
    }
  }

  /** Clear the perception of AVs; the map stays as long as its scene. */
  clear() {
    this.#seen.clear();
    this.#estimates.clear();
    this.#scans.clear();
  }

  /**
   * Return the objects that an AV's planner has been told of.
   * @param av index of the AV
   * @param t time that is shown [s]
   * @returns columns: vehicles, then objects; null while unknown
   */
  seenBy(av: number, t: number): Float64Array | null {
    const frame = this.#seen.get(av);
    return frame !== undefined && t - frame.t < SEEN_LASTS_S && frame.t - t < AHEAD_S
      ? frame.columns : null;
  }

  /**
   * Return the estimated pose of an AV: the last estimate, extrapolated.
   * @param av index of the AV
   * @param t time that is shown [s]
   */
  estimateOf(av: number, t: number): ShownEstimate | null {
    const ring = this.#estimates.get(av);
    const sample = ring?.at(Math.max(ring.indexAt(t + 1e-9), 0));
    if (sample === undefined || Math.abs(t - sample.t) > ESTIMATE_LASTS_S) {
      return null;
    }
    const passed = t - sample.t;
    const turned = sample.yaw_rate * passed;
    const heading = sample.yaw + 0.5 * turned;
    const { n, xx, xy, yy } = sample;
    return {
      n, xx, xy, yy, x: sample.x + sample.speed * passed * Math.cos(heading),
      y: sample.y + sample.speed * passed * Math.sin(heading),
      yaw: turn(0, sample.yaw + turned, 1),
    };
  }

  /**
   * Return the newest scan of each sensor of an AV that is not too old.
   * @param av index of the AV
   * @param t time that is shown [s]
   */
  scansOf(av: number, t: number): ScanFrame[] {
    return [...this.#scans.values()].filter((scan) => scan.index === av
      && t - scan.t < SCAN_PERIODS * scan.period_s + SCAN_LASTS_S && scan.t - t < AHEAD_S);
  }
}
