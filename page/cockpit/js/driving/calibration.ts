// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The dialog that measures which axes of a device steer, and how far, and tries the mapping. */

import { element, setAttribute, setText } from '../dom.js';
import { CalibrationRun, STEPS } from './calibration_run.js';
import { connectedPads } from './gamepad.js';
import { gearAfter, loadProfile, pedalValue, sampleOf, steeringValue } from './gamepad_profile.js';
import { pedalBar, steeringBar, steeringWheel } from './gauges.js';

import type { CalibrationStep, Kind, Place } from './calibration_run.js';
import type { Control, Profile, Sample } from './gamepad_profile.js';

const TEXTS: Record<CalibrationStep, [title: string, instruction: string]> = {
  centre: ['Rest', 'Hold the wheel or stick straight, take your feet off the pedals, then press '
    + 'Next.'],
  left: ['Left', 'Turn fully left, then back to straight.'],
  right: ['Right', 'Turn fully right, then back to straight.'],
  throttle: ['Throttle', 'Press the throttle fully, then let it go.'],
  brake: ['Brake', 'Press the brake fully, then let it go.'],
  reverse: ['Reverse', 'Press the button that shall change between forward and reverse.'],
  left_indicator: ['Indicator left', 'Press the button that shall indicate to the left.'],
  right_indicator: ['Indicator right', 'Press the button that shall indicate to the right.'],
  hazard: ['Hazard', 'Press the button of the hazard lights.'],
  horn: ['Horn', 'Press the button of the horn.'],
  put_back: ['Back on the lane', 'Press the button that shall put the vehicle back on its lane '
    + 'after a contact.'],
  test: ['Test', 'Try it. Dead zones and directions can be changed here; Save keeps everything '
    + 'in this browser for this device.'],
};

/** One dialog, opened for one device after the other. */
export class CalibrationDialog {
  #save;
  #pad: Gamepad | null = null;
  #run: CalibrationRun | null = null;
  #frame = 0;
  #bars: RawBars | null = null;
  #test = new CalibrationTest();
  #heading = element('h2', { id: 'calibration-title' });
  #steps = STEPS.map((step) => element('li', { text: TEXTS[step][0] }));
  #instruction = element('p', { class: 'calibration-instruction', 'aria-live': 'assertive' });
  #found = element('p', { class: 'calibration-found', role: 'status' });
  #live = element('div', { class: 'calibration-live' });
  #skip = this.#button('Skip', () => this.#run?.skip());
  #next = this.#button('Next', () => this.#finishStep(), 'primary');
  #dialog = element('dialog', {
    class: 'calibration', 'aria-labelledby': 'calibration-title', on: { close: () => this.#end() },
  }, this.#heading, element('ol', { class: 'calibration-steps' }, ...this.#steps),
  this.#instruction, this.#found, this.#test.node, this.#live,
  element('div', { class: 'dialog-buttons' },
    this.#button('Use the default mapping', () => this.#close(null)),
    this.#button('Cancel', () => this.#dialog.close()), this.#skip, this.#next));

  /** @param save called with the index of the device and its new mapping, null for the default */
  constructor(save: (index: number, profile: Profile | null) => void) {
    this.#save = save;
    document.body.append(this.#dialog);
  }

  /** @param index of the device to calibrate */
  open(index: number) {
    this.#pad = connectedPads().find((pad) => pad.index === index) ?? null;
    if (this.#pad === null || this.#dialog.open) {
      return;
    }
    this.#run = new CalibrationRun(loadProfile(this.#pad).profile);
    this.#bars = new RawBars(sampleOf(this.#pad));
    this.#live.replaceChildren(this.#bars.node);
    setText(this.#heading, `Calibrate ${this.#pad.id}`);
    this.#dialog.showModal();
    this.#next.focus();
    this.#poll(performance.now());
  }

  /** Close it, and take it out of the page. */
  remove() {
    this.#dialog.close();
    this.#dialog.remove();
  }

  #poll(now_ms: number) {
    const pad = connectedPads().find(({ index }) => index === this.#pad?.index);
    if (pad === undefined) {
      setText(this.#instruction, 'The device is unplugged. Plug it in again and press a button.');
    } else if (this.#run !== null) {
      const sample = sampleOf(pad);
      this.#run.feed(sample, now_ms);
      this.#bars?.show(sample, this.#run.found);
      this.#show(sample, this.#run);
    }
    this.#frame = requestAnimationFrame((at_ms) => this.#poll(at_ms));
  }

  #show(sample: Sample, run: CalibrationRun) {
    const { step, found } = run;
    const testing = step === 'test';
    this.#steps.forEach((item, i) => {
      setAttribute(item, 'aria-current', STEPS[i] === step ? 'step' : null);
      setAttribute(item, 'data-done', i < STEPS.indexOf(step));
    });
    setText(this.#instruction, TEXTS[step][1]);
    const measures = !testing && step !== 'centre';
    setText(this.#found, found
      ? `${found.kind === 'axis' ? 'Axis' : 'Button'} ${found.index} moves`
      : measures ? 'Nothing moves yet' : '');
    setText(this.#next, testing ? 'Save' : 'Next');
    setAttribute(this.#next, 'disabled', measures && found === null);
    setAttribute(this.#skip, 'hidden', !measures);
    this.#test.show(testing ? run.profile : null, sample);
  }

  #finishStep() {
    if (this.#run?.step === 'test') {
      this.#close(this.#run.profile);
    } else {
      this.#run?.next();
    }
  }

  #close(profile: Profile | null) {
    if (this.#pad !== null) {
      this.#save(this.#pad.index, profile);
    }
    this.#dialog.close();
  }

  #end() {
    cancelAnimationFrame(this.#frame);
    this.#test.show(null);
  }

  #button(text: string, act: () => void, kind = '') {
    return element('button', { type: 'button', class: `drive-button ${kind}`, text,
      on: { click: act } });
  }
}

interface Row { node: HTMLElement; fill: HTMLElement; value: HTMLElement | null }

/** Bars for each axis (-1 to 1) and button (0 to 1). */
class RawBars {
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

type ControlName = 'steering' | 'throttle' | 'brake';

const NAMES: Record<ControlName, string> = {
  steering: 'Steering', throttle: 'Throttle', brake: 'Brake',
};
const CONTROLS = Object.keys(NAMES) as ControlName[];
const MOST_DEADZONE = 0.3;

/** A view of a profile at work; `node` goes into the dialog. */
class CalibrationTest {
  #profile: Profile | null = null;
  #reverse = false;
  #pressed: boolean[] = [];
  #wheel = steeringWheel();
  #bars = {
    steering: steeringBar(), throttle: pedalBar('throttle', 'Throttle'),
    brake: pedalBar('brake', 'Brake'),
  };
  #gear = element('span', { class: 'hud-gear', text: 'D' });
  #tuning = element('div', { class: 'tuning' });
  node = element('div', { class: 'calibration-test', hidden: true },
    element('div', { class: 'calibration-seen' }, this.#bars.brake.node, this.#bars.throttle.node,
      this.#wheel.node, this.#bars.steering.node, this.#gear),
    this.#tuning);

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
