// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Bars that show a command, solid, and the raw key behind it, outlined. */

import { element, setAttribute, setText } from '../dom.js';

const scaled = (share: number) => (Number.isFinite(share) ? share : 0).toFixed(3);

/** An upright bar of one pedal. */
export class PedalBar {
  #fill;
  #key;
  #value;
  node;

  /** `kind`: 'throttle' or 'brake'; `label` under the bar. */
  constructor(kind: string, label: string) {
    this.#fill = element('div', { class: 'bar-fill' });
    this.#key = element('div', { class: 'bar-key' });
    this.#value = element('span', { class: 'bar-value', text: '–' });
    this.node = element('div', { class: `pedal pedal-${kind}` },
      element('div', { class: 'bar' }, this.#fill, this.#key),
      this.#value, element('span', { class: 'bar-label', text: label }));
  }

  /**
   * Show the bar and the outline of its key.
   * @param command 0 to 1, NaN if no command is in force
   * @param key whether its key is held
   */
  show(command: number, key: boolean) {
    const transform = `scaleY(${scaled(command)})`;
    if (this.#fill.style.transform !== transform) {
      this.#fill.style.transform = transform;
    }
    setAttribute(this.#key, 'data-on', key);
  }

  /** @param command written beside the bar in per cent */
  write(command: number) {
    setText(this.#value, Number.isFinite(command) ? `${Math.round(100 * command)} %` : '–');
  }
}

/** A horizontal bar of the steering, with its zero in the middle. */
export class SteeringBar {
  #fill = element('div', { class: 'bar-fill' });
  #left = element('div', { class: 'bar-key bar-left' });
  #right = element('div', { class: 'bar-key bar-right' });
  node;

  constructor() {
    this.node = element('div', { class: 'bar steering-bar' },
      this.#fill, this.#left, this.#right, element('div', { class: 'bar-zero' }));
  }

  /**
   * Show the bar and the outlines of its keys.
   * @param command -1 (right) to 1 (left), NaN if no command is in force
   * @param left whether a left key is held
   * @param right whether a right key is held
   */
  show(command: number, left: boolean, right: boolean) {
    // The fill grows from the middle to the right; a left command mirrors it.
    const transform = `scaleX(${scaled(-command)})`;
    if (this.#fill.style.transform !== transform) {
      this.#fill.style.transform = transform;
    }
    setAttribute(this.#left, 'data-on', left);
    setAttribute(this.#right, 'data-on', right);
  }
}
