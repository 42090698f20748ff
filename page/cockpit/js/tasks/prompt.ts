// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** One stimulus or request on this page: the times of its first picture and of its answer. */

/** @import { GameTask, OpenPrompt, PageTimes } from './task_messages.js' */
/** @import { RunningTime } from './running_time.js' */

/** A prompt from its message to its end. All times are those of performance.now [ms]. */
export class Prompt {
  /** Time at which the first picture with it was drawn; NaN before. */
  drawn_ms = NaN;
  /** Time from then to the beginning of the next picture. */
  picture_ms = NaN;
  /** Whether it was answered here. */
  answered = false;

  #running;
  #received_ms;
  #way_ms;
  #pausedBefore_ms = 0;

  /**
   * @param {OpenPrompt} open
   * @param {GameTask} task
   * @param {RunningTime} running
   * @param {number} received_ms when its message arrived
   * @param {number} round_trip_ms round-trip time to the server; NaN if unknown
   */
  constructor(open, task, running, received_ms, round_trip_ms) {
    this.open = open;
    this.task = task;
    this.#running = running;
    this.#received_ms = received_ms;
    this.#way_ms = Number.isFinite(round_trip_ms) ? round_trip_ms / 2 : 0;
  }

  /** @param {number} drawn_ms when its first picture was drawn */
  draw(drawn_ms) {
    this.drawn_ms = drawn_ms;
    this.#pausedBefore_ms = this.#running.paused(drawn_ms);
  }

  /**
   * @param {number} now_ms
   * @returns {number} how long it has been visible, without pauses; NaN before it is drawn
   */
  since(now_ms) {
    return now_ms - this.drawn_ms - this.#paused(now_ms);
  }

  /**
   * @param {number} now_ms
   * @returns {boolean} whether its light is on
   */
  lit(now_ms) {
    return !this.answered && !this.#running.stands
      && this.since(now_ms) < 1000 * (this.task.shown_s ?? 0);
  }

  /**
   * @param {number} now_ms
   * @returns {boolean} whether it accepts an answer
   */
  accepts(now_ms) {
    const since_ms = this.since(now_ms);
    return !this.answered && since_ms >= 0 && since_ms <= 1000 * (this.task.latest_s ?? 0);
  }

  /**
   * @param {number} [answer_ms] when it was answered
   * @returns {PageTimes}
   */
  times(answer_ms) {
    const delay_ms = this.drawn_ms - this.#received_ms + this.#way_ms;
    const seen = { delay_ms, picture_ms: this.picture_ms };
    return answer_ms === undefined ? seen
      : { ...seen, response_ms: this.since(answer_ms), paused_ms: this.#paused(answer_ms) };
  }

  /** @param {number} now_ms */
  #paused(now_ms) {
    return this.#running.paused(now_ms) - this.#pausedBefore_ms;
  }
}

/**
 * Apply a change just before a picture, and measure when that and the next one were drawn.
 *
 * @param {() => void} change changes the picture
 * @returns {Promise<{drawn_ms: number, picture_ms: number}>} when it was drawn (the browser runs
 *   a message that is sent in an animation frame after it has painted that frame), and the time
 *   from the beginning of this frame to that of the next
 */
export function inPicture(change) {
  return new Promise((resolve) => {
    requestAnimationFrame((frame_ms) => {
      change();
      let drawn_ms = NaN;
      const channel = new MessageChannel();
      channel.port1.onmessage = () => {
        drawn_ms = performance.now();
        channel.port1.close();
      };
      channel.port2.postMessage(null);
      requestAnimationFrame((next_ms) => {
        // A busy page may handle the message late, but never later than its next picture.
        resolve({ drawn_ms: Math.min(Number.isNaN(drawn_ms) ? next_ms : drawn_ms, next_ms),
          picture_ms: next_ms - frame_ms });
      });
    });
  });
}
