// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The page's clock without the pauses of the run. */

/** Counts how long the run has stood still, so that no answer is timed over a pause. */
export class RunningTime {
  #paused_ms = 0;
  #since_ms = NaN;

  /** Return whether the run stands still, as far as the page knows. */
  get stands() {
    return !Number.isNaN(this.#since_ms);
  }

  /**
   * Take note of whether the run runs.
   *
   * @param {boolean} runs
   * @param {number} now_ms as performance.now gives it
   */
  note(runs, now_ms) {
    if (runs && this.stands) {
      this.#paused_ms += now_ms - this.#since_ms;
      this.#since_ms = NaN;
    } else if (!runs && !this.stands) {
      this.#since_ms = now_ms;
    }
  }

  /**
   * @param {number} now_ms as performance.now gives it
   * @returns {number} how long the run has stood still until then, since the page began [ms]
   */
  paused(now_ms) {
    return this.#paused_ms + (this.stands ? Math.max(now_ms - this.#since_ms, 0) : 0);
  }
}
