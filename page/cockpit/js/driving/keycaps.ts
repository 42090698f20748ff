// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The driving keys as they lie on the keyboard, lit while held; they can be pressed by touch. */

import { element, setAttribute, setText } from '../dom.js';

import type { Keyboard } from './keyboard.js';

// The place of a key, its label, the other key with the same function, and a sign beside it.
const CAPS: [code: string, text: string, twin: string | null, title: string, sign?: string][] = [
  ['KeyW', 'W', 'ArrowUp', 'Throttle'], ['KeyR', 'R', null, 'Reverse gear'],
  ['KeyA', 'A', 'ArrowLeft', 'Left'], ['KeyS', 'S', 'ArrowDown', 'Brake'],
  ['KeyD', 'D', 'ArrowRight', 'Right'], ['Space', 'Space', null, 'Brake'],
  ['Comma', ',', null, 'Left indicator', '◄'], ['Period', '.', null, 'Right indicator', '►'],
  ['KeyJ', 'J', null, 'Hazard lights', '◄►'], ['KeyG', 'G', null, 'Horn', '♪'],
];

/** The drawn keys; `node` goes into the page. */
export class Keycaps {
  #caps = new Map<string, HTMLElement>();
  node;

  /** @param keyboard receives touch presses */
  constructor(keyboard: Pick<Keyboard, 'press' | 'lift'>) {
    for (const [code, text, , title, sign] of CAPS) {
      const lift = () => keyboard.lift(code);
      this.#caps.set(code, element('kbd', { class: `cap cap-${code}`, title,
        text: sign === undefined ? text : `${text} ${sign}`, on: {
        pointerdown: (event) => {
          event.preventDefault();
          // A finger that slides off the key still holds it.
          (event.currentTarget as HTMLElement).setPointerCapture(event.pointerId);
          keyboard.press(code);
        },
        pointerup: lift, pointercancel: lift, lostpointercapture: lift,
        contextmenu: (event) => event.preventDefault(),
      } }));
    }
    this.node = element('div', { class: 'keycaps', role: 'group',
      'aria-label': 'Keys: W throttle, A left, S brake, D right, space brake, R reverse, '
        + 'comma and period indicators, J hazard lights, G horn, Backspace back on the lane '
        + 'after a contact' },
    ...this.#caps.values());
    this.#readLayout();
  }

  /** Light the held keys; `reverse`: whether the reverse gear is requested. */
  show(keyboard: Keyboard, reverse: boolean) {
    for (const [code, , twin] of CAPS) {
      const on = code === 'KeyR' ? reverse
        : keyboard.isHeld(code) || (twin !== null && keyboard.isHeld(twin));
      setAttribute(this.#cap(code), 'data-on', on);
    }
  }

  /** @param code of CAPS */
  #cap(code: string): HTMLElement {
    return this.#caps.get(code) as HTMLElement;
  }

  /** Write the labels of the user's keyboard layout, if the browser knows it. */
  async #readLayout() {
    const layout = await navigator.keyboard?.getLayoutMap?.().catch(() => undefined);
    for (const [code, text, , , sign] of CAPS) {
      const key = layout?.get(code)?.toUpperCase() ?? text;
      setText(this.#cap(code), sign === undefined ? key : `${key} ${sign}`);
    }
  }
}
