// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Answers that are not on the server yet, stored so that a reload loses nothing. */

import { session } from '../../cockpit/js/panels/memory.js';

import type { Answer, DeskDocument } from './desk_messages.js';

const PREFIX = 'crgame.draft.';

export interface DraftState {
  shown_at: number;
  answers: Record<string, Answer>;
  after_s: Record<string, number>;
}

/** The draft of one item, in this tab's storage. */
export class Draft {
  #key;
  #clock_s;
  #state: DraftState;

  /** `name` of it, see draftName; `clock_s`: seconds since 1970. */
  constructor(name: string, clock_s: () => number) {
    this.#key = PREFIX + name;
    this.#clock_s = clock_s;
    this.#state = read(this.#key) ?? { shown_at: clock_s(), answers: {}, after_s: {} };
    this.#write();
  }

  /** @returns by the question's name */
  get answers(): Record<string, Answer> {
    return this.#state.answers;
  }

  /** Keep an answer; `name` of the question. */
  put(name: string, answer: Answer) {
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

  #since(now_s: number) {
    return Math.max(0, Math.round(1000 * (now_s - this.#state.shown_at)) / 1000);
  }

  #write() {
    session.set(this.#key, JSON.stringify(this.#state));
  }
}

/** Return the name of the shown item's draft; a repeated item gets a new one. */
export function draftName({ study, participant, item, again }: DeskDocument) {
  return `${study}.${participant}.${item}.${again}`;
}

/** Remove all drafts but one: earlier answers are on the server; `name` of the one that stays. */
export function forgetOtherDrafts(name: string) {
  session.keys(PREFIX).filter((key) => key !== PREFIX + name)
    .forEach((key) => session.remove(key));
}

function read(key: string): DraftState | null {
  try {
    const state = JSON.parse(session.get(key) ?? 'null');
    return Number.isFinite(state?.shown_at) && state.answers && state.after_s ? state : null;
  } catch {
    return null;
  }
}
