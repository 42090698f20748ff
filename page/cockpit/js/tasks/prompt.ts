// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** One stimulus or request on this page: the times of its first picture and of its answer. */

import { painted } from '../painted.js';

import type { GameTask, OpenPrompt, PageTimes } from './task_messages.js';
import type { ServerTime } from '../server_clock.js';

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

/** A prompt from its message to its end. All times are those of performance.now [ms]. */
export class Prompt {
  /** Time at which the first picture with it was drawn; NaN before. */
  drawn_ms = NaN;
  /** Time from then to the beginning of the next picture. */
  picture_ms = NaN;
  /** The first picture's time on the server's clock; null where this is not known. */
  shown: ServerTime | null = null;
  /** Whether it was answered here. */
  answered = false;

  #running;
  #received_ms;
  #way_ms;
  #pausedBefore_ms = 0;
  open;
  task;

  /**
   * @param received_ms when its message arrived
   * @param round_trip_ms round-trip time to the server; NaN if unknown
   */
  constructor(open: OpenPrompt, task: GameTask, running: RunningTime, received_ms: number,
    round_trip_ms: number) {
    this.open = open;
    this.task = task;
    this.#running = running;
    this.#received_ms = received_ms;
    this.#way_ms = Number.isFinite(round_trip_ms) ? round_trip_ms / 2 : 0;
  }

  /** @param drawn_ms when its first picture was drawn */
  draw(drawn_ms: number) {
    this.drawn_ms = drawn_ms;
    this.#pausedBefore_ms = this.#running.paused(drawn_ms);
  }

  /** @returns how long it has been visible, without pauses; NaN before it is drawn */
  since(now_ms: number): number {
    return now_ms - this.drawn_ms - this.#paused(now_ms);
  }

  /** @returns whether its light is on */
  lit(now_ms: number): boolean {
    return !this.answered && !this.#running.stands
      && this.since(now_ms) < 1000 * (this.task.shown_s ?? 0);
  }

  /** @returns whether it accepts an answer */
  accepts(now_ms: number): boolean {
    const since_ms = this.since(now_ms);
    return !this.answered && since_ms >= 0 && since_ms <= 1000 * (this.task.latest_s ?? 0);
  }

  /** @param answer_ms when it was answered */
  times(answer_ms?: number): PageTimes {
    const delay_ms = this.drawn_ms - this.#received_ms + this.#way_ms;
    const seen = { delay_ms, picture_ms: this.picture_ms, ...this.shown };
    return answer_ms === undefined ? seen
      : { ...seen, response_ms: this.since(answer_ms), paused_ms: this.#paused(answer_ms) };
  }

  #paused(now_ms: number) {
    return this.#running.paused(now_ms) - this.#pausedBefore_ms;
  }
}

/**
 * Apply a change just before a picture, and measure when that and the next one were drawn.
 * @param change changes the picture
 * @returns when it was drawn, and the time from the beginning of this frame to that of the next
 */
export function inPicture(change: () => void): Promise<{ drawn_ms: number; picture_ms: number }> {
  return new Promise((resolve) => {
    requestAnimationFrame((frame_ms) => {
      change();
      let drawn_ms = NaN;
      painted().then((at_ms) => { drawn_ms = at_ms; });
      requestAnimationFrame((next_ms) => {
        // A busy page may handle the message late, but never later than its next picture.
        resolve({ drawn_ms: Math.min(Number.isNaN(drawn_ms) ? next_ms : drawn_ms, next_ms),
          picture_ms: next_ms - frame_ms });
      });
    });
  });
}
