// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The device check: the participant moves each control once, and the page detects it. */

import { element, setAttribute, setText } from '../../cockpit/js/dom.js';
import { CalibrationDialog } from '../../cockpit/js/driving/calibration.js';
import { connectedPads } from '../../cockpit/js/driving/gamepad.js';
import {
  loadProfile, pedalValue, sampleOf, saveProfile, steeringValue,
} from '../../cockpit/js/driving/gamepad_profile.js';
import { ACTIONS } from '../../cockpit/js/driving/keyboard.js';
import { button } from './page_view.js';

import type { DeviceDocument } from './desk_messages.js';
import type { Words } from './words.js';
import type { Profile } from '../../cockpit/js/driving/gamepad_profile.js';

export type Movement = 'left' | 'right' | 'throttle' | 'brake';

const MOVEMENTS: Movement[] = ['left', 'right', 'throttle', 'brake'];
// This share of its travel counts as moved.
const MOVED = 0.6;
// An axis this far from its first position was moved by the participant.
const TOUCHED = 0.4;
const KEYBOARD = 'keyboard';

/** The check, until it is left. */
export class DeviceCheck {
  #words;
  #finish;
  #chosen = KEYBOARD;
  // Whether the participant has chosen the device, so that touching one no longer chooses it.
  #told = false;
  #rest = new Map<string, number[]>(); // where the axes were first, by the device
  #moved = new Set<Movement>();
  #frame = 0;
  #list = element('ul', { class: 'movements' });
  #devices = element('div', { class: 'options choices', role: 'radiogroup' });
  #none = element('p', { class: 'hint' });
  #problem = element('p', { class: 'problem', role: 'alert' });
  #calibrate;
  #calibration = new CalibrationDialog((index, profile) => this.#keep(index, profile));
  #ids = '';
  #key = (event: KeyboardEvent) => this.#press(event);
  node;

  constructor({ text }: DeviceDocument, words: Words,
    finish: (told: { device: string; moved: string[] }) => void) {
    this.#words = words;
    this.#finish = finish;
    this.#calibrate = button(words.of('device_calibrate'), '',
      () => this.#calibration.open(Number(this.#chosen)));
    setText(this.#none, words.of('device_none'));
    this.node = element('div', { class: 'device-check' },
      element('h2', { text: words.of('device') }),
      element('p', { class: 'lead', text: text || words.of('device_text') }),
      element('fieldset', { class: 'question' },
        element('legend', {}, element('span', { class: 'ask', text: words.of('device_choose') })),
        this.#devices, this.#none, this.#calibrate),
      this.#list, this.#problem,
      element('div', { class: 'go-on' },
        button(words.of('next'), 'primary', () => this.#goOn())));
    window.addEventListener('keydown', this.#key, true);
    this.#poll();
  }

  /** Stop listening, and leave nothing in the page. */
  end() {
    this.#calibration.remove();
    cancelAnimationFrame(this.#frame);
    window.removeEventListener('keydown', this.#key, true);
  }

  #poll() {
    const pads = connectedPads();
    const ids = pads.map(({ id, index }) => `${index} ${id}`).join('\n');
    if (ids !== this.#ids || !this.#devices.hasChildNodes()) {
      this.#ids = ids;
      this.#showDevices(pads);
    }
    this.#chooseTouched(pads);
    const pad = pads.find(({ index }) => `${index}` === this.#chosen);
    if (pad) {
      const { profile } = loadProfile(pad);
      const sample = sampleOf(pad);
      const steering = steeringValue(sample, profile.steering);
      this.#note('left', steering > MOVED);
      this.#note('right', steering < -MOVED);
      this.#note('throttle', pedalValue(sample, profile.throttle) > MOVED);
      this.#note('brake', pedalValue(sample, profile.brake) > MOVED);
    }
    this.#frame = requestAnimationFrame(() => this.#poll());
  }

  /**
   * Choose a wheel or gamepad that is moved or pressed, unless the check of the keys is complete.
   */
  #chooseTouched(pads: Gamepad[]) {
    for (const pad of pads) {
      const key = `${pad.index} ${pad.id}`;
      const rest = this.#rest.get(key) ?? pad.axes.map(Number);
      this.#rest.set(key, rest);
      const touched = pad.buttons.some(({ pressed }) => pressed)
        || pad.axes.some((value, i) => Math.abs(value - rest[i]) > TOUCHED);
      if (touched && !this.#told && this.#chosen === KEYBOARD
          && this.#moved.size < MOVEMENTS.length) {
        this.#choose(`${pad.index}`);
        for (const input of this.#devices.querySelectorAll('input')) {
          input.checked = input.value === this.#chosen;
        }
      }
    }
  }

  #showDevices(pads: Gamepad[]) {
    const option = (value: string, label: string): HTMLElement => {
      const input = element('input', { type: 'radio', name: 'device', value,
        on: { change: () => {
          this.#told = true;
          this.#choose(value);
        } } });
      input.checked = value === this.#chosen;
      return element('label', { class: 'option' }, input, element('span', { text: label }));
    };
    if (this.#chosen !== KEYBOARD && !pads.some(({ index }) => `${index}` === this.#chosen)) {
      this.#chosen = KEYBOARD;
    }
    this.#devices.replaceChildren(option(KEYBOARD, this.#words.of('device_keyboard')),
      ...pads.map(({ id, index }) => option(`${index}`, id)));
    this.#none.hidden = pads.length > 0;
    this.#choose(this.#chosen);
  }

  #choose(chosen: string) {
    if (chosen !== this.#chosen) {
      this.#moved.clear();
    }
    this.#chosen = chosen;
    this.#calibrate.hidden = chosen === KEYBOARD;
    this.#showList();
  }

  #press(event: KeyboardEvent) {
    const movement = MOVEMENTS.find((name) => name === ACTIONS[event.code]);
    const { target } = event;
    // Arrows choose in a group, and the space bar presses a button, as in any browser.
    const used = (target instanceof HTMLInputElement && event.code.startsWith('Arrow'))
      || (target instanceof HTMLButtonElement && event.code === 'Space');
    if (this.#chosen === KEYBOARD && movement && !used) {
      event.preventDefault();
      this.#note(movement, true);
    }
  }

  #note(movement: Movement, moved: boolean) {
    if (moved && !this.#moved.has(movement)) {
      this.#moved.add(movement);
      this.#showList();
    }
  }

  #showList() {
    const keys = this.#chosen === KEYBOARD;
    this.#list.replaceChildren(...MOVEMENTS.map((name) => {
      const done = this.#moved.has(name);
      return element('li', { 'data-done': done },
        element('span', { class: 'done-mark', 'aria-hidden': 'true', text: done ? '✓' : '○' }),
        element('span', { text: this.#words.of(`device_${name}`) }),
        keys ? element('kbd', { text: this.#words.of(`device_keys_${name}`) }) : null,
        done ? element('span', { class: 'unseen', text: ` (${this.#words.of('done')})` }) : null);
    }));
    const complete = this.#moved.size === MOVEMENTS.length;
    // From then on the device's buttons also choose and confirm here.
    setAttribute(this.node, 'data-complete', complete);
    if (complete) {
      setText(this.#problem, '');
    }
  }

  #keep(index: number, profile: Profile | null) {
    const pad = connectedPads().find((candidate) => candidate.index === index);
    if (pad) {
      saveProfile(pad.id, profile);
      this.#moved.clear();
      this.#showList();
    }
  }

  #goOn() {
    const missing = MOVEMENTS.filter((name) => !this.#moved.has(name));
    setText(this.#problem, missing.length === 0 ? '' : this.#words.of('device_missing', {
      names: missing.map((name) => this.#words.of(`device_${name}`)).join(', ') }));
    if (missing.length === 0) {
      const pad = connectedPads().find(({ index }) => `${index}` === this.#chosen);
      this.#finish({ device: (pad?.id ?? KEYBOARD).slice(0, 200), moved: [...this.#moved] });
    }
  }
}
