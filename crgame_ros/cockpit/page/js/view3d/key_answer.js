// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * Pictures out of turn: where the processor draws, they come seldom, and what a key does would be
 * seen only with the next. A few more, just when the vehicle answers, are cheap.
 */

// A key is obeyed in the simulation's next cycle: that is simulated time [s]. Its way there and
// back takes time of the wall, up to so much [s].
const FIRST_S = 0.008;
const WAY_S = 0.042;
const MOST_PICTURES = 3;

/** The simulation times at which the answer to a key is looked for. */
export class KeyAnswer {
  #pressed_t = NaN;
  #last_s = 0;
  #left = 0;

  /**
   * A key that drives has gone down or up.
   *
   * @param {number} newest_t of the newest state that has come [s]
   * @param {number} rate simulated seconds per second
   */
  pressed(newest_t, rate) {
    this.#pressed_t = newest_t;
    this.#last_s = FIRST_S + WAY_S * rate;
    this.#left = MOST_PICTURES;
  }

  /**
   * Return whether a picture may show the answer.
   *
   * @param {number} t simulation time that it would show [s]
   * @returns {boolean} false too once there have been enough
   */
  isDue(t) {
    const since_s = t - this.#pressed_t;
    return this.#left > 0 && since_s >= FIRST_S && since_s <= this.#last_s;
  }

  /** A picture has been drawn out of turn. */
  drawn() {
    this.#left -= 1;
  }
}
