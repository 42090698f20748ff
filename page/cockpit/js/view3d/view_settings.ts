// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The 3D view's buttons, and its user's settings, which the browser remembers. */

import { element, setAttribute } from '../dom.js';
import { recall, remember } from '../panels/memory.js';
import { press, toolButton } from '../world/toolbar.js';
import { VIEWPOINTS } from './cameras.js';
import { FIELD_OF_VIEW, readSeat } from './field_of_view.js';

import type { Viewpoint } from './cameras.js';
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
  switches = Object.fromEntries(
    SWITCHES.map(({ name, on }) => [name, on])) as Record<Switch, boolean>;
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

const CUBE = 'M12 3l8 4.5v9L12 21l-8-4.5v-9zM12 12l8-4.5M12 12v9M12 12L4 7.5';
const SLIDERS = 'M4 7h9M17 7h3M15 5v4M4 17h3M11 17h9M9 15v4';
const VIEWS: Record<Viewpoint, { strokes: string; title: string }> = {
  driver: { strokes: 'M12 4a8 8 0 1 0 0 16a8 8 0 1 0 0-16M4.5 11c4-2 11-2 15 0M12 14v6'
    + 'M10 13l-5 3M14 13l5 3', title: "Driver's eye (C: next)" },
  chase: { strokes: 'M5 16v-4l2-5h10l2 5v4zM5 12h14M7 16v3M17 16v3', title: 'Behind (C: next)' },
  bird: { strokes: 'M12 3v10M8 9l4 4l4-4M5 20h14M8 16.5h8', title: 'From above (C: next)' },
};

/** Put the buttons on the stage; `update` shows the state. */
export function createViewButtons(stage: HTMLElement, settings: ViewSettings,
  { toggle, choose }: { toggle: () => void;
  choose: (viewpoint: Viewpoint) => void }): { update: (on: boolean,
  viewpoint: Viewpoint) => void } {
  const group = element('div', { class: 'world-group view3d-buttons' });
  const cube = toolButton(group, CUBE, '3D view or map (V)', toggle);
  const views = VIEWPOINTS.map((name) => ({ name, button: toolButton(
    group, VIEWS[name].strokes, VIEWS[name].title, () => choose(name)) }));
  let open = false;
  const sliders = toolButton(group, SLIDERS, 'Settings of the 3D view', () => {
    open = !open;
    settings.open(open);
    sliders.setAttribute('aria-expanded', String(open));
  });
  sliders.setAttribute('aria-expanded', 'false');
  const bar = stage.querySelector('.world-toolbar');
  bar?.prepend(group);
  stage.append(settings.node);
  return {
    update(on, viewpoint) {
      press(cube, on);
      for (const { name, button } of views) {
        button.hidden = !on;
        press(button, name === viewpoint);
      }
      sliders.hidden = !on;
      settings.open(on && open);
    },
  };
}
