// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A drawn steering wheel that turns with the steering command. */

import { setAttribute, svg } from '../dom.js';

// Half a turn would look the same on both sides; with 150 degrees at full lock, they differ.
const FULL_LOCK_DEG = 150;

/** One drawing; `node` goes into the page. */
export class SteeringWheel {
  #turning;
  node;

  constructor() {
    this.#turning = svg('g', { class: 'wheel-turning' },
      svg('circle', { class: 'wheel-rim', r: 42 }),
      svg('path', { class: 'wheel-spokes', d: 'M-40 4 L-12 2 M40 4 L12 2 M0 12 L0 40' }),
      svg('circle', { class: 'wheel-hub', r: 13 }),
      svg('path', { class: 'wheel-top', d: 'M-8 -41.2 A42 42 0 0 1 8 -41.2' }));
    this.node = svg('svg', {
      class: 'wheel', viewBox: '-50 -50 100 100', role: 'img', 'aria-label': 'Steering wheel',
    }, this.#turning);
  }

  /** Turn the wheel; `steering`: -1 (right) to 1 (left). */
  turn(steering: number) {
    const angle = Number.isFinite(steering) ? -steering * FULL_LOCK_DEG : 0;
    setAttribute(this.#turning, 'transform', `rotate(${angle.toFixed(1)})`);
  }
}
