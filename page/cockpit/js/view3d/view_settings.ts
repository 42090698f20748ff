// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The user's settings of the 3D view, which the browser remembers. */

import { element, setAttribute } from '../dom.js';
import { recall, remember } from '../panels/memory.js';
import { FIELD_OF_VIEW, readSeat } from './field_of_view.js';

import type { Seat } from './field_of_view.js';

export type Switch = 'mirrors' | 'inset' | 'plans' | 'sharp';

const SWITCHES: { name: Switch; text: string; on: boolean }[] = [
  { name: 'mirrors', text: 'Mirrors', on: true },
  { name: 'inset', text: 'Small map', on: true },
  // A driver could not see what an AV plans or perceives.
  { name: 'plans', text: 'What AVs plan and perceive', on: false },
  { name: 'sharp', text: 'Full resolution, however slow', on: false },
];

/** The settings and their form. */
export class ViewSettings {
  switches: Record<Switch, boolean> = { mirrors: true, inset: true, plans: false, sharp: false };
  fieldOfView_deg = FIELD_OF_VIEW.usual;
  seat: Seat | null = null;
  node;
  #changed;
  #angle = element('input', { type: 'range', min: FIELD_OF_VIEW.least, max: FIELD_OF_VIEW.most,
    step: 1, on: { input: () => this.#read() } });
  #angleText = element('output', {});
  #isTrue = element('input', { type: 'checkbox', on: { change: () => this.#read() } });
  #width = centimetres('Width of the screen', () => this.#read());
  #distance = centimetres('Eyes from the screen', () => this.#read());

  /** @param changed called after each choice */
  constructor(changed: () => void) {
    this.#changed = changed;
    this.#angle.value = recall('view3d-angle') || String(FIELD_OF_VIEW.usual);
    this.#isTrue.checked = recall('view3d-true') === '1';
    this.#width.input.value = recall('view3d-screen');
    this.#distance.input.value = recall('view3d-distance');
    this.node = element('div', { class: 'view3d-settings', role: 'group',
      'aria-label': 'Settings of the 3D view', hidden: true },
    element('label', {}, element('span', { text: 'Field of view' }), this.#angle,
      this.#angleText),
    element('label', { class: 'view3d-check' }, this.#isTrue,
      element('span', { text: 'True to scale' })),
    this.#width.label, this.#distance.label, ...SWITCHES.map((item) => this.#switch(item)));
    this.#read();
  }

  /** @param open whether the form is visible */
  open(open: boolean) {
    setAttribute(this.node, 'hidden', !open);
  }

  set(name: Switch, on: boolean) {
    this.switches[name] = on;
    const input = this.node.querySelector(`[name=${name}]`);
    if (input instanceof HTMLInputElement) {
      input.checked = on;
    }
    remember(`view3d-${name}`, on ? '1' : '0');
    this.#changed();
  }

  /**
   * Choose for this page only: the browser does not remember it.
   * @param fieldOfView_deg null leaves it as it is [deg]
   */
  fix(switches: Record<Switch, boolean>, fieldOfView_deg: number | null) {
    this.switches = { ...switches };
    if (fieldOfView_deg !== null) {
      this.fieldOfView_deg = fieldOfView_deg;
      this.seat = null;
    }
    this.#changed();
  }

  #switch({ name, text, on }: typeof SWITCHES[number]) {
    const input = element('input', { type: 'checkbox', name,
      on: { change: () => this.set(name, input.checked) } });
    input.checked = recall(`view3d-${name}`) === '' ? on : recall(`view3d-${name}`) === '1';
    this.switches[name] = input.checked;
    return element('label', { class: 'view3d-check' }, input, element('span', { text }));
  }

  #read() {
    const [width, distance] = [this.#width.input.value, this.#distance.input.value];
    this.fieldOfView_deg = Number(this.#angle.value);
    this.seat = this.#isTrue.checked ? readSeat(width, distance) : null;
    this.#angleText.textContent = `${this.fieldOfView_deg}°`;
    this.#angle.disabled = this.seat !== null;
    for (const { label, input } of [this.#width, this.#distance]) {
      label.hidden = !this.#isTrue.checked;
      setAttribute(input, 'aria-invalid',
        this.#isTrue.checked && this.seat === null ? 'true' : null);
    }
    remember('view3d-angle', this.#angle.value);
    remember('view3d-true', this.#isTrue.checked ? '1' : '');
    remember('view3d-screen', width);
    remember('view3d-distance', distance);
    this.#changed();
  }
}

function centimetres(text: string, changed: () => void) {
  const input = element('input', { type: 'number', min: 5, max: 2000, step: 'any',
    inputmode: 'decimal', on: { input: changed } });
  return { input, label: element('label', {}, element('span', { text }), input,
    element('span', { text: 'cm' })) };
}
