// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The signs of indicators and horn over the speed, lit like the vehicle's. */

import { element, setAttribute } from '../dom.js';
import { LIGHT, shining } from '../lights.js';

const SIGNS: [name: 'left' | 'horn' | 'right', sign: string, title: string][] = [
  ['left', '◄', 'Left indicator'], ['horn', '♪', 'Horn'], ['right', '►', 'Right indicator'],
];

/** Three signs; `node` goes into the instruments. */
export class LightSigns {
  #signs = SIGNS.map(([name, text, title]) => ({
    name, title, node: element('span', { class: `sign sign-${name}`, role: 'img', title, text }),
  }));
  node;

  constructor() {
    this.node = element('div', { class: 'hud-lights' }, ...this.#signs.map(({ node }) => node));
  }

  /** Update the signs; `lights` as the vehicle's state has them; `t`: simulation time [s]. */
  show(lights: number, t: number) {
    const shines = shining(lights, t);
    for (const { name, title, node } of this.#signs) {
      // Screen readers are told once, not at each blink.
      setAttribute(node, 'aria-label', `${title} ${(lights & LIGHT[name]) > 0 ? 'on' : 'off'}`);
      setAttribute(node, 'data-on', shines[name]);
    }
  }
}
