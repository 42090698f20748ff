// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Bars that show a command, solid, and the raw key behind it, outlined; a steering wheel. */

import { element, setAttribute, setText, svg } from '../dom.js';

// Half a turn would look the same on both sides; with 150 degrees at full lock, they differ.
const FULL_LOCK_DEG = 150;

/** Stretch the filled part of a bar; a share of NaN is none. */
function stretch(fill: HTMLElement, axis: 'X' | 'Y', share: number) {
  const transform = `scale${axis}(${(Number.isFinite(share) ? share : 0).toFixed(3)})`;
  if (fill.style.transform !== transform) {
    fill.style.transform = transform;
  }
}

/** Make an upright bar of a pedal, `kind` 'throttle' or 'brake', with a label under it. */
export function pedalBar(kind: string, label: string) {
  const fill = element('div', { class: 'bar-fill' });
  const key = element('div', { class: 'bar-key' });
  const value = element('span', { class: 'bar-value', text: '–' });
  return {
    node: element('div', { class: `pedal pedal-${kind}` },
      element('div', { class: 'bar' }, fill, key), value,
      element('span', { class: 'bar-label', text: label })),
    /** Show a command, 0 to 1 or NaN if none is in force, and whether its key is held. */
    show(command: number, held: boolean) {
      stretch(fill, 'Y', command);
      setAttribute(key, 'data-on', held);
    },
    /** Write a command beside the bar in per cent. */
    write(command: number) {
      setText(value, Number.isFinite(command) ? `${Math.round(100 * command)} %` : '–');
    },
  };
}

/** Make a horizontal bar of the steering, with its zero in the middle. */
export function steeringBar() {
  const fill = element('div', { class: 'bar-fill' });
  const keys = ['left', 'right'].map((side) => element('div', { class: `bar-key bar-${side}` }));
  return {
    node: element('div', { class: 'bar steering-bar' },
      fill, ...keys, element('div', { class: 'bar-zero' })),
    /** Show a command, -1 (right) to 1 (left) or NaN for none, and whether its keys are held. */
    show(command: number, left: boolean, right: boolean) {
      // The fill grows from the middle to the right; a left command mirrors it.
      stretch(fill, 'X', -command);
      setAttribute(keys[0], 'data-on', left);
      setAttribute(keys[1], 'data-on', right);
    },
  };
}

/** Draw a steering wheel. */
export function steeringWheel() {
  const turning = svg('g', { class: 'wheel-turning' },
    svg('circle', { class: 'wheel-rim', r: 42 }),
    svg('path', { class: 'wheel-spokes', d: 'M-40 4 L-12 2 M40 4 L12 2 M0 12 L0 40' }),
    svg('circle', { class: 'wheel-hub', r: 13 }),
    svg('path', { class: 'wheel-top', d: 'M-8 -41.2 A42 42 0 0 1 8 -41.2' }));
  return {
    node: svg('svg', { class: 'wheel', viewBox: '-50 -50 100 100', role: 'img',
      'aria-label': 'Steering wheel' }, turning),
    /** Turn the wheel with a command, -1 (right) to 1 (left). */
    turn(steering: number) {
      const angle = Number.isFinite(steering) ? -steering * FULL_LOCK_DEG : 0;
      setAttribute(turning, 'transform', `rotate(${angle.toFixed(1)})`);
    },
  };
}
