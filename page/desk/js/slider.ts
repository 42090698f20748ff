// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A line without a mark until the participant sets one. */

import { element, setAttribute } from '../../cockpit/js/dom.js';

import type { SliderQuestion } from './desk_messages.js';
import type { Controls } from './question_view.js';
import type { Words } from './words.js';

/** Build the controls of a slider question; `id` of its input. */
export function sliderControls({ low, high, step, bare, left, right }: SliderQuestion,
  words: Words, id: string, changed: () => void): Controls {
  const input = element('input', { id, type: 'range', min: low, max: high, step,
    class: bare ? 'slider bare' : 'slider' });
  let marked = false;
  const show = () => {
    setAttribute(input, 'data-unset', !marked);
    setAttribute(input, 'aria-valuetext', marked ? null : words.of('slider_unset'));
  };
  const mark = () => {
    marked = true;
    show();
    changed();
  };
  input.addEventListener('input', mark);
  // A click in the exact middle does not change the value but is an answer, as are these keys.
  // A finger's tap there causes no click event.
  for (const kind of ['click', 'pointerup']) {
    input.addEventListener(kind, () => {
      if (!marked) {
        mark();
      }
    });
  }
  input.addEventListener('keydown', ({ key }) => {
    if (!marked && (key === 'Enter' || key === ' ')) {
      mark();
    }
  });
  input.value = String((low + high) / 2);
  show();
  const count = Math.round((high - low) / step);
  const ticks = !bare && count <= 40
    ? element('div', { class: 'ticks', 'aria-hidden': 'true' },
      ...Array.from({ length: count + 1 }, () => element('i'))) : null;
  return {
    node: element('div', { class: 'slider-row' }, input, ticks,
      element('div', { class: 'ends' }, element('span', { text: left }),
        element('span', { text: right }))),
    inputs: [input],
    answer: () => (marked ? Number(input.value) : null),
    set: (answer) => {
      marked = typeof answer === 'number';
      input.value = String(marked ? answer : (low + high) / 2);
      show();
    },
    refusal: () => '',
  };
}
