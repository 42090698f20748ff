// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * Extra pictures after a key press. If the processor renders, pictures are rare, and the effect of
 * a key would show only in the next. A few more, just when the vehicle answers, are cheap.
 */

// A key takes effect in the simulation's next cycle, in simulated time [s]. The round trip takes
// wall time, up to this [s].
const FIRST_S = 0.008;
const WAY_S = 0.042;
const MOST_PICTURES = 3;

/** The simulation times at which the answer to a key can appear. */
export class KeyAnswer {
  #pressed_t = NaN;
  #last_s = 0;
  #left = 0;

  /**
   * Record that a driving key was pressed or released.
   * @param newest_t of the newest state that has come [s]
   * @param rate simulated seconds per second
   */
  pressed(newest_t: number, rate: number) {
    this.#pressed_t = newest_t;
    this.#last_s = FIRST_S + WAY_S * rate;
    this.#left = MOST_PICTURES;
  }

  /**
   * Return whether a picture may show the answer.
   * @param t simulation time that it would show [s]
   * @returns false too once there have been enough
   */
  isDue(t: number): boolean {
    const since_s = t - this.#pressed_t;
    return this.#left > 0 && since_s >= FIRST_S && since_s <= this.#last_s;
  }

  /** Record that an extra picture was drawn. */
  drawn() {
    this.#left -= 1;
  }
}
