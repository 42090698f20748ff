// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The driving keys as they lie on the keyboard, lit while they are held. */

import { element, setAttribute, setText } from '../dom.js';

/** @import { Keyboard } from './keyboard.js' */

// The place of a key, what it reads, and the other key that does the same.
/** @type {[code: string, text: string, twin: string|null, title: string][]} */
const CAPS = [
  ['KeyW', 'W', 'ArrowUp', 'Throttle'], ['KeyR', 'R', null, 'Reverse gear'],
  ['KeyA', 'A', 'ArrowLeft', 'Left'], ['KeyS', 'S', 'ArrowDown', 'Brake'],
  ['KeyD', 'D', 'ArrowRight', 'Right'], ['Space', 'Space', null, 'Brake'],
];

/** The drawn keys; `node` goes into the page. */
export class Keycaps {
  /** @type {Map<string, HTMLElement>} */
  #caps = new Map();

  constructor() {
    for (const [code, text, , title] of CAPS) {
      this.#caps.set(code, element('kbd', { class: `cap cap-${code}`, title, text }));
    }
    this.node = element('div', { class: 'keycaps', role: 'img',
      'aria-label': 'Keys: W throttle, A left, S brake, D right, space brake, R reverse' },
    ...this.#caps.values());
    this.#takeLayout();
  }

  /**
   * Light the held keys.
   *
   * @param {Keyboard} keyboard
   * @param {boolean} reverse whether the reverse gear is asked for
   */
  show(keyboard, reverse) {
    for (const [code, , twin] of CAPS) {
      const on = code === 'KeyR' ? reverse
        : keyboard.isHeld(code) || (twin !== null && keyboard.isHeld(twin));
      setAttribute(this.#cap(code), 'data-on', on);
    }
  }

  /**
   * @param {string} code of CAPS
   * @returns {HTMLElement}
   */
  #cap(code) {
    return /** @type {HTMLElement} */ (this.#caps.get(code));
  }

  /** Write what the keys read on this person's keyboard, where the browser knows it. */
  async #takeLayout() {
    const layout = await navigator.keyboard?.getLayoutMap?.().catch(() => undefined);
    for (const [code, text] of CAPS) {
      setText(this.#cap(code), layout?.get(code)?.toUpperCase() ?? text);
    }
  }
}
