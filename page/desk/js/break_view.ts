// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A break with its minimum duration. */

import { element, setAttribute, setText } from '../../cockpit/js/dom.js';
import { button } from './page_view.js';

import type { BreakDocument } from './desk_messages.js';
import type { Words } from './words.js';

export function breakView({ text, left_s }: BreakDocument, words: Words,
  finish: () => void): HTMLElement {
  const over_ms = performance.now() + 1000 * left_s;
  const left = element('p', { class: 'left', role: 'timer' });
  const told = element('p', { role: 'status' });
  const next = button(words.of('next'), 'primary', finish);
  const node = element('div', {}, element('h2', { text: words.of('break') }),
    text ? element('p', { class: 'lead', text }) : null, left, told,
    element('div', { class: 'go-on' }, next));
  const show = () => {
    const rest_s = Math.max(0, Math.ceil((over_ms - performance.now()) / 1000));
    const was = next.disabled;
    setAttribute(next, 'disabled', rest_s > 0);
    setText(left, rest_s > 0 ? words.of('break_left', { time: clockTime(rest_s) }) : '');
    setText(told, rest_s > 0 ? '' : words.of('break_over'));
    if (was && rest_s === 0) {
      next.focus();
    }
    if (rest_s > 0 && (node.isConnected || !was)) {
      setTimeout(show, 250);
    }
  };
  show();
  return node;
}

/** Return whole seconds as minutes:seconds. */
export function clockTime(time_s: number): string {
  return `${Math.floor(time_s / 60)}:${String(time_s % 60).padStart(2, '0')}`;
}
