// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The last step of the calibration: a test of the mapping, with fine tuning. */

import { element, setAttribute, setText } from '../dom.js';
import { gearAfter, pedalValue, steeringValue } from './gamepad_profile.js';
import { PedalBar, SteeringBar } from './gauges.js';
import { SteeringWheel } from './steering_wheel.js';

import type { Control, Profile, Sample } from './gamepad_profile.js';

export type ControlName = 'steering' | 'throttle' | 'brake';

const NAMES: Record<ControlName, string> = {
  steering: 'Steering', throttle: 'Throttle', brake: 'Brake',
};
const CONTROLS = Object.keys(NAMES) as ControlName[];
const MOST_DEADZONE = 0.3;

/** A view of a profile at work; `node` goes into the dialog. */
export class CalibrationTest {
  #profile: Profile | null = null;
  #reverse = false;
  #pressed: boolean[] = [];
  #wheel = new SteeringWheel();
  #bars = {
    steering: new SteeringBar(), throttle: new PedalBar('throttle', 'Throttle'),
    brake: new PedalBar('brake', 'Brake'),
  };
  #gear = element('span', { class: 'hud-gear', text: 'D' });
  #tuning = element('div', { class: 'tuning' });
  node;

  constructor() {
    const { steering, throttle, brake } = this.#bars;
    this.node = element('div', { class: 'calibration-test', hidden: true },
      element('div', { class: 'calibration-seen' }, brake.node, throttle.node, this.#wheel.node,
        steering.node, this.#gear),
      this.#tuning);
  }

  /** Show the effect of a sample; `profile`: null hides this view. */
  show(profile: Profile | null, sample?: Sample) {
    setAttribute(this.node, 'hidden', profile === null);
    if (profile !== this.#profile) {
      this.#profile = profile;
      this.#reverse = false;
      this.#pressed = [];
      this.#tuning.replaceChildren(...profile === null ? []
        : CONTROLS.map((name) => this.#row(name, profile[name])));
    }
    if (profile !== null && sample !== undefined) {
      this.#move(profile, sample);
    }
  }

  #move(profile: Profile, sample: Sample) {
    const steering = steeringValue(sample, profile.steering);
    this.#wheel.turn(steering);
    this.#bars.steering.show(steering, false, false);
    for (const name of ['throttle', 'brake'] as const) {
      const value = pedalValue(sample, profile[name]);
      this.#bars[name].show(value, false);
      this.#bars[name].write(value);
    }
    sample.buttons.forEach((value, i) => {
      if ((value > 0.5) !== (this.#pressed[i] ?? false)) {
        this.#pressed[i] = value > 0.5;
        this.#reverse = gearAfter(profile.reverse, this.#reverse, i, value > 0.5);
      }
    });
    setText(this.#gear, this.#reverse ? 'R' : 'D');
    setAttribute(this.#gear, 'data-gear', this.#reverse ? 'R' : 'D');
  }

  #row(name: ControlName, control: Control) {
    const shown = element('output', { text: percent(control.deadzone) });
    const range = element('input', { type: 'range', min: 0, max: MOST_DEADZONE, step: 0.01,
      value: control.deadzone, 'aria-label': `Dead zone of ${NAMES[name]}` });
    range.addEventListener('input', () => {
      control.deadzone = Number(range.value);
      setText(shown, percent(control.deadzone));
    });
    const turned = element('input', { type: 'checkbox' });
    turned.checked = control.invert;
    turned.addEventListener('change', () => {
      control.invert = turned.checked;
    });
    const where = `${control.kind === 'axis' ? 'Axis' : 'Button'} ${control.index}`;
    return element('div', { class: 'tuning-row' },
      element('strong', { text: NAMES[name] }), element('span', { text: where }),
      element('label', {}, 'Dead zone ', range, shown),
      element('label', {}, turned, ' Inverted'));
  }
}

function percent(share: number) {
  return `${Math.round(100 * share)} %`;
}
