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
  // The last samples, the oldest first.
  #arrivals: { t: number; at_ms: number }[] = [];
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
    this.#arrivals = [];
    this.#shown = NaN;
  }

  /** Record the arrival of a sample; `t`: its simulation time [s]; `now_ms`: when it arrived. */
  arrived(t: number, now_ms: number) {
    const last = this.#arrivals.at(-1);
    if (last !== undefined && (now_ms - last.at_ms > SILENCE_MS || t <= last.t)) {
      this.#arrivals = [];
    }
    this.#arrivals.push({ t, at_ms: now_ms });
    if (this.#arrivals.length > WINDOW) {
      this.#arrivals.shift();
    }
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
    if (!runs || this.#arrivals.length === 0) {
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
    const count = this.#arrivals.length;
    const [oldest, newest] = [this.#arrivals[0], this.#arrivals[count - 1]];
    const span_ms = newest.at_ms - oldest.at_ms;
    const enough = count >= FEWEST && span_ms >= SHORTEST_SPAN_MS;
    const measured = enough ? (newest.t - oldest.t) / span_ms * 1000 : this.factor;
    this.rate = Math.abs(measured / this.factor - 1) < STEADY ? this.factor : measured;
    this.period_ms = count > 1 ? span_ms / (count - 1) : 10;
    const leads = this.#arrivals.map(({ t, at_ms }) => t - this.rate * at_ms / 1000);
    const lead = Math.max(...leads);
    const late_ms = leads.map((each) => (lead - each) / this.rate * 1000);
    const mean = late_ms.reduce((sum, each) => sum + each, 0) / count;
    const squares = late_ms.reduce((sum, each) => sum + each * each, 0);
    const deviation = Math.sqrt(Math.max(squares / count - mean * mean, 0));
    this.#lead = lead;
    this.jitter_ms = Math.min(mean + 2 * deviation, MAX_JITTER_MS);
    this.delay_ms = this.period_ms + this.jitter_ms + GUARD_MS;
  }
}
