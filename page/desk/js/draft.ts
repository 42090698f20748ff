// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Answers that are not on the server yet, stored so that a reload loses nothing. */

/** @import { Answer, DeskDocument } from './desk_messages.js' */

const PREFIX = 'crgame.draft.';

/**
 * @typedef {{shown_at: number, answers: Record<string, Answer>,
 *   after_s: Record<string, number>}} DraftState
 */

/** The draft of one item, in this tab's storage. */
export class Draft {
  #key;
  #clock_s;
  /** @type {DraftState} */
  #state;

  /**
   * @param {string} name of it, see draftName
   * @param {() => number} clock_s seconds since 1970
   */
  constructor(name, clock_s) {
    this.#key = PREFIX + name;
    this.#clock_s = clock_s;
    this.#state = read(this.#key) ?? { shown_at: clock_s(), answers: {}, after_s: {} };
    this.#write();
  }

  /** @returns {Record<string, Answer>} by the question's name */
  get answers() {
    return this.#state.answers;
  }

  /**
   * Keep an answer.
   *
   * @param {string} name of the question
   * @param {Answer} answer
   */
  put(name, answer) {
    this.#state.answers[name] = answer;
    this.#state.after_s[name] = this.#since(this.#clock_s());
    this.#write();
  }

  /** Return when the item was shown and answered, and the time of each question's answer. */
  times() {
    const now_s = this.#clock_s();
    return { shown_at: this.#state.shown_at, answered_at: now_s, taken_s: this.#since(now_s),
      after_s: this.#state.after_s };
  }

  /** @param {number} now_s */
  #since(now_s) {
    return Math.max(0, Math.round(1000 * (now_s - this.#state.shown_at)) / 1000);
  }

  #write() {
    try {
      sessionStorage.setItem(this.#key, JSON.stringify(this.#state));
    } catch {
      // A full or forbidden storage: a reload then asks again.
    }
  }
}

/**
 * Return the name of the shown item's draft; a repeated item gets a new one.
 *
 * @param {DeskDocument} shown
 */
export function draftName({ study, participant, item, again }) {
  return `${study}.${participant}.${item}.${again}`;
}

/**
 * Remove all drafts but one: earlier answers are on the server.
 *
 * @param {string} name of the one that stays
 */
export function forgetOtherDrafts(name) {
  for (const key of Object.keys(sessionStorage)) {
    if (key.startsWith(PREFIX) && key !== PREFIX + name) {
      sessionStorage.removeItem(key);
    }
  }
}

/**
 * @param {string} key
 * @returns {DraftState|null}
 */
function read(key) {
  try {
    const state = JSON.parse(sessionStorage.getItem(key) ?? 'null');
    return Number.isFinite(state?.shown_at) && state.answers && state.after_s ? state : null;
  } catch {
    return null;
  }
}
