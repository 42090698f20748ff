// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A moving bar during a long task, with a text and the elapsed seconds. */

import { element, setText } from '../dom.js';

const SHOWN_AFTER_MS = 300;
const COUNTED_AFTER_S = 2;

/** Hidden until begun. */
export class Busy {
  #text = element('span', {});
  #timer = 0;
  #since = 0;
  #words = '';
  root;

  constructor() {
    this.root = element('div', { class: 'busy', role: 'status', hidden: true },
      element('div', { class: 'busy-bar', 'aria-hidden': 'true' }), this.#text);
  }

  /**
   * Start, or change the text; the seconds count from the first call.
   * @param words what is being done
   */
  describe(words: string) {
    this.#words = words;
    if (this.#timer === 0) {
      this.#since = performance.now();
      this.#timer = setInterval(() => this.#show(), 100);
    }
    this.#show();
  }

  /** Hide it. */
  end() {
    clearInterval(this.#timer);
    this.#timer = 0;
    this.root.hidden = true;
  }

  #show() {
    const passed_ms = performance.now() - this.#since;
    this.root.hidden = passed_ms < SHOWN_AFTER_MS;
    const seconds = Math.floor(passed_ms / 1e3);
    setText(this.#text,
      seconds >= COUNTED_AFTER_S ? `${this.#words} ${seconds} s` : this.#words);
  }
}
