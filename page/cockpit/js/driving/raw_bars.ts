// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Live bars of all raw values of a device, before any mapping. */

import { element, setAttribute, setText } from '../dom.js';

import type { Kind, Place } from './calibration_run.js';
import type { Sample } from './gamepad_profile.js';

export interface Row { node: HTMLElement; fill: HTMLElement; value: HTMLElement | null }

/** Bars for each axis (-1 to 1) and button (0 to 1). */
export class RawBars {
  #rows: Record<Kind, Row[]> = { axis: [], button: [] };
  node;

  /** @param sample of the device, for its number of axes and buttons */
  constructor(sample: Sample) {
    const axes = sample.axes.map((_, i) => this.#row('axis', `Axis ${i}`));
    const buttons = sample.buttons.map((_, i) => this.#row('button', `${i}`));
    this.node = element('div', { class: 'raw-bars' },
      element('div', { class: 'raw-axes' }, ...axes),
      element('div', { class: 'raw-buttons', 'aria-label': 'Buttons' },
        element('span', { class: 'bar-label', text: 'Buttons' }), ...buttons));
  }

  /** Show a sample; `found`: the moved control, which is marked. */
  show(sample: Sample, found: Place | null) {
    this.#showAll('axis', sample.axes, found);
    this.#showAll('button', sample.buttons, found);
  }

  #showAll(kind: Kind, values: number[], found: Place | null) {
    this.#rows[kind].forEach((row, index) => {
      const value = values[index] ?? 0;
      row.fill.style.transform = kind === 'axis' ? `scaleX(${value.toFixed(3)})`
        : `scaleY(${value.toFixed(3)})`;
      if (row.value) {
        setText(row.value, value.toFixed(2));
      }
      setAttribute(row.node, 'data-found', found?.kind === kind && found.index === index);
    });
  }

  #row(kind: Kind, text: string) {
    const fill = element('div', { class: 'bar-fill' });
    const value = kind === 'axis' ? element('span', { class: 'bar-value' }) : null;
    const node = element('div', { class: `raw-${kind}` },
      element('span', { class: 'bar-label', text }),
      element('div', { class: 'bar' }, fill), value);
    this.#rows[kind].push({ node, fill, value });
    return node;
  }
}
