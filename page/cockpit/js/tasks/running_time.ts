// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The page's clock without the pauses of the run. */

/** A counter of the run's pauses, so that they do not count in the times of answers. */
export class RunningTime {
  #paused_ms = 0;
  #since_ms = NaN;

  /** Return whether the run stands still, according to the last status. */
  get stands() {
    return !Number.isNaN(this.#since_ms);
  }

  /** Record whether the run is running; `now_ms` from performance.now. */
  note(runs: boolean, now_ms: number) {
    if (runs && this.stands) {
      this.#paused_ms += now_ms - this.#since_ms;
      this.#since_ms = NaN;
    } else if (!runs && !this.stands) {
      this.#since_ms = now_ms;
    }
  }

  /** Return the total pause since the page was loaded [ms]; `now_ms` from performance.now. */
  paused(now_ms: number): number {
    return this.#paused_ms + (this.stands ? Math.max(now_ms - this.#since_ms, 0) : 0);
  }
}
