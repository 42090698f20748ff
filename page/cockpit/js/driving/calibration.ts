// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The dialog that measures which axes of a device steer, and their range. */

import { element, setAttribute, setText } from '../dom.js';
import { CalibrationRun, STEPS } from './calibration_run.js';
import { CalibrationTest } from './calibration_test_view.js';
import { connectedPads } from './gamepad.js';
import { loadProfile, sampleOf } from './gamepad_profile.js';
import { RawBars } from './raw_bars.js';

import type { CalibrationStep } from './calibration_run.js';
import type { Profile, Sample } from './gamepad_profile.js';

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
