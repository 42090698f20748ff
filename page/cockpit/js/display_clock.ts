// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * The clock that selects which simulation time the page shows now.
 *
 * Samples arrive with jitter. The clock runs evenly at the measured rate. It lags the earliest
 * arrivals by one sample period plus the jitter, so that the sample after the shown time has
 * usually arrived. At 100 Hz this is about 15 ms.
 */

const WINDOW = 64;
const FEWEST = 8;
const SHORTEST_SPAN_MS = 150;
// A longer silence was a pause or a stall, after which the old measurement is invalid.
const SILENCE_MS = 600;
const GUARD_MS = 1;
// A measured rate this near the requested one is taken for the requested one.
const STEADY = 0.03;
const MAX_JITTER_MS = 100;
const MAX_LEAD_S = 0.1;
const SNAP_S = 0.25;
const SETTLE_MS = 250;

/** A map from wall time [ms] to the simulation time to show [s]. */
export class DisplayClock {
  #t = new Float64Array(WINDOW);
  #at = new Float64Array(WINDOW);
  #count = 0;
  #next = 0;
  #shown = NaN;
  #shownAt_ms = 0;

  /** Simulated seconds per second until enough samples allow a measurement. */
  factor = 1;
  /** Measured: simulated seconds per second, sample period, jitter, delay [ms]. */
  rate = 1;
  period_ms = 0;
  jitter_ms = 0;
  delay_ms = 0;
  #lead = 0;

  /** Reset the clock: the next sample is shown at once. */
  reset() {
    this.#count = 0;
    this.#next = 0;
    this.#shown = NaN;
  }

  /** Record the arrival of a sample; `t`: its simulation time [s]; `now_ms`: when it arrived. */
  arrived(t: number, now_ms: number) {
    const last = (this.#next + WINDOW - 1) % WINDOW;
    if (this.#count > 0 && (now_ms - this.#at[last] > SILENCE_MS || t <= this.#t[last])) {
      this.#count = 0;
      this.#next = 0;
    }
    this.#t[this.#next] = t;
    this.#at[this.#next] = now_ms;
    this.#next = (this.#next + 1) % WINDOW;
    this.#count = Math.min(this.#count + 1, WINDOW);
    this.#measure();
  }

  /**
   * Return the simulation time to show.
   * @param now_ms wall time of the frame, which never goes back
   * @param newest_t of the newest sample [s]
   * @param runs false while the simulation stands still
   * @returns simulation time [s]
   */
  time(now_ms: number, newest_t: number, runs: boolean): number {
    if (!runs || this.#count === 0) {
      this.#shown = newest_t;
    } else {
      const elapsed_ms = Math.max(now_ms - this.#shownAt_ms, 0);
      const target = this.#lead + this.rate * (now_ms - this.delay_ms) / 1000;
      const free = this.#shown + this.rate * elapsed_ms / 1000;
      const error = target - free;
      if (!(Math.abs(error) < SNAP_S * Math.max(this.rate, 1))) {
        this.#shown = target;
      } else {
        const settled = free + error * (1 - Math.exp(-elapsed_ms / SETTLE_MS));
        this.#shown = Math.max(this.#shown, settled);
      }
      this.#shown = Math.min(this.#shown, newest_t + MAX_LEAD_S * Math.min(this.rate, 1));
    }
    this.#shownAt_ms = now_ms;
    return this.#shown;
  }

  #measure() {
    const oldest = this.#count < WINDOW ? 0 : this.#next;
    const newest = (this.#next + WINDOW - 1) % WINDOW;
    const span_ms = this.#at[newest] - this.#at[oldest];
    const enough = this.#count >= FEWEST && span_ms >= SHORTEST_SPAN_MS;
    const measured = enough ? (this.#t[newest] - this.#t[oldest]) / span_ms * 1000 : this.factor;
    this.rate = Math.abs(measured / this.factor - 1) < STEADY ? this.factor : measured;
    this.period_ms = this.#count > 1 ? span_ms / (this.#count - 1) : 10;
    let lead = -Infinity;
    for (let i = 0; i < this.#count; i += 1) {
      lead = Math.max(lead, this.#t[i] - this.rate * this.#at[i] / 1000);
    }
    let sum = 0;
    let squares = 0;
    for (let i = 0; i < this.#count; i += 1) {
      const late_ms = (lead + this.rate * this.#at[i] / 1000 - this.#t[i]) / this.rate * 1000;
      sum += late_ms;
      squares += late_ms * late_ms;
    }
    const mean = sum / this.#count;
    const deviation = Math.sqrt(Math.max(squares / this.#count - mean * mean, 0));
    this.#lead = lead;
    this.jitter_ms = Math.min(mean + 2 * deviation, MAX_JITTER_MS);
    this.delay_ms = this.period_ms + this.jitter_ms + GUARD_MS;
  }
}
