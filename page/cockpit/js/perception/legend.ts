// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The legend of the marks of perception, beside the map while they are shown. */

import { element, setAttribute, setText, svg } from '../dom.js';

// name: [strokes in a box of 28 x 16, words]; $ is the AV. The styles are in world.css.
const ENTRIES: Record<string, [strokes: string, words: string]> = {
  unseen: ['M14 2a6 6 0 1 0 .01 0z', 'not seen by $'],
  rays: ['M2 14L26 2V14z', 'what the sensors of $ reach'],
  estimate: ['M3 4h22v8H3z', 'estimated pose of $, 2σ'],
  occupancy: ['M3 3h10v10H3zM15 3h10v10H15z', 'permanent obstacles'],
};

// Replaces the first entry while the planner's knowledge is unknown.
const UNKNOWN = 'what $ sees is not known now';

/** A small table over the map. */
export class Legend {
  #root;
  #rows = new Map<string, { row: HTMLElement; text: HTMLElement }>();

  /** @param stage that holds the canvas */
  constructor(stage: HTMLElement) {
    this.#root = element('ul', { class: 'world-legend', 'aria-label': 'Legend', hidden: true });
    for (const [name, [strokes]] of Object.entries(ENTRIES)) {
      const text = element('span', {});
      const row = element('li', { 'data-layer': name, hidden: true },
        svg('svg', { viewBox: '0 0 28 16', 'aria-hidden': 'true' },
          svg('path', { d: strokes })), text);
      this.#rows.set(name, { row, text });
      this.#root.append(row);
    }
    stage.append(this.#root);
  }

  /**
   * Show the entries of the layers on the map.
   * @param names of the layers
   * @param av id of the AV that is followed
   * @param known whether it is known what it sees
   */
  show(names: string[], av: string, known: boolean) {
    for (const [name, { row, text }] of this.#rows) {
      const words = name === 'unseen' && !known ? UNKNOWN : ENTRIES[name][1];
      setText(text, words.replace('$', av));
      setAttribute(row, 'hidden', !names.includes(name));
    }
    setAttribute(this.#root, 'hidden', names.length === 0);
  }
}
