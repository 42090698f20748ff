// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * Pictures out of turn: where the processor draws, they come seldom, and what a key does would be
 * seen only with the next. A few more, just when the vehicle answers, are cheap.
 */

// A key goes to the simulation, is obeyed in the next cycle, and its state comes back: after so
// much simulated time the first state that answers is shown, or, with bad luck, the last [s].
const FIRST_S = 0.008;
const LAST_S = 0.05;

/** The simulation times at which the answer to a key is looked for. */
export class KeyAnswer {
  #pressed_t = NaN;

  /**
   * A key that drives has gone down or up.
   *
   * @param {number} newest_t of the newest state that has come [s]
   */
  pressed(newest_t) {
    this.#pressed_t = newest_t;
  }

  /**
   * Tell whether a picture may show the answer.
   *
   * @param {number} t simulation time that it would show [s]
   * @returns {boolean}
   */
  isDue(t) {
    const since_s = t - this.#pressed_t;
    return since_s >= FIRST_S && since_s <= LAST_S;
  }
}
