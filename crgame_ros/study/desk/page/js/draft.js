// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** What has been answered but is not kept by the server yet: a reload loses nothing of it. */

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

  /** Give when the item was shown and is answered, and after which time each question was. */
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
    sessionStorage.setItem(this.#key, JSON.stringify(this.#state));
  }
}

/**
 * Name the draft of what is shown: an item that comes again is asked anew.
 *
 * @param {DeskDocument} shown
 */
export function draftName({ study, participant, item, again }) {
  return `${study}.${participant}.${item}.${again}`;
}

/**
 * Forget all drafts but one: what was asked before is with the server.
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
