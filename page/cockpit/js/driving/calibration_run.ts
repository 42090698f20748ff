// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * The measurement behind the calibration dialog: the axis or button that is moved, and how far.
 *
 * It uses no clock and no page: the caller passes samples and times.
 */

import { LIGHT_BUTTONS } from '../lights.js';

import type { Control, LightButtons, Profile, Sample } from './gamepad_profile.js';

/** The steering's axis at its left end, as measured in its step. */
export interface LeftEnd extends Place { centre: number; end: number }

export type CalibrationStep = 'centre' | 'left' | 'right' | 'throttle' | 'brake' | 'reverse'
  | 'put_back' | 'test' | typeof LIGHT_BUTTONS[number];
export type Kind = Control['kind'];
export interface Place { kind: Kind; index: number } // of an axis or button

/** The steps in their order. */
export const STEPS: readonly CalibrationStep[] = Object.freeze([
  'centre', 'left', 'right', 'throttle', 'brake', 'reverse', ...LIGHT_BUTTONS, 'put_back',
  'test',
]);

// A smaller movement of an axis or button does not count.
const LEAST_SPAN = 0.3;
// A control is back once it rests within this share of its span.
const BACK_SHARE = 0.25;
const BACK_FOR_MS = 500;
const DEADZONE = 0.03;
// A first change from 0 beyond this is the axis's first true value, not a movement.
const MADE_UP = 0.5;

/** One run through the steps. */
export class CalibrationRun {
  #start: Sample | null = null;
  #first: Sample | null = null;
  #low: Sample | null = null;
  #high: Sample | null = null;
  #sample: Sample | null = null;
  #centre: Sample | null = null;
  #left: LeftEnd | null = null;
  #backSince_ms = NaN;
  profile;
  step;

  /** @param profile kept by skipped steps */
  constructor(profile: Profile) {
    this.profile = structuredClone(profile);
    this.step = STEPS[0];
  }

  /** @returns the control that is moved in this step */
  get found(): (Place & { span: number }) | null {
    return this.#sample && this.#asksForMovement ? this.#largest() : null;
  }

  get #asksForMovement() {
    return this.step !== 'centre' && this.step !== 'test';
  }

  /**
   * Add a sample; a step ends by itself when the moved control is back at rest.
   * @returns whether the step ended
   */
  feed(sample: Sample, now_ms: number): boolean {
    this.#sample = sample;
    this.#start ??= sample;
    this.#first = merged((before, start, now) => (before === start ? now : before),
      this.#first ?? this.#start, this.#start, sample);
    this.#low = merged(Math.min, this.#low ?? sample, sample);
    this.#high = merged(Math.max, this.#high ?? sample, sample);
    const found = this.found;
    if (found === null || !this.#isBack(found)) {
      this.#backSince_ms = NaN;
      return false;
    }
    if (Number.isNaN(this.#backSince_ms)) {
      this.#backSince_ms = now_ms;
    }
    return now_ms - this.#backSince_ms >= BACK_FOR_MS && this.next();
  }

  /**
   * End this step with what was measured.
   * @returns false when nothing that fits has been moved yet
   */
  next(): boolean {
    if (this.step === 'test' || this.#sample === null) {
      return false;
    }
    if (this.step === 'centre') {
      this.#centre = this.#sample;
    } else {
      const found = this.found;
      if (found === null) {
        return false;
      }
      this.#keep(found);
    }
    this.#advance();
    return true;
  }

  /** Skip this step and keep its control as it was. */
  skip() {
    // Left and right are one measurement.
    if (this.step === 'left') {
      this.#advance();
    }
    this.#advance();
  }

  #advance() {
    this.step = STEPS[Math.min(STEPS.indexOf(this.step) + 1, STEPS.length - 1)];
    this.#start = this.#first = this.#low = this.#high = this.#sample;
    this.#backSince_ms = NaN;
  }

  #keep({ kind, index }: Place) {
    const [low, high] = [this.#low, this.#high].map((sample) => valueOf(sample, kind, index));
    if (this.step === 'left') {
      const centre = valueOf(this.#centre, kind, index);
      this.#left = { kind, index, centre, end: farther(low, high, centre) };
    } else if (this.step === 'right') {
      this.profile.steering = this.#steering(low, high);
    } else if (this.step === 'reverse') {
      this.#free(index);
      this.profile.reverse = { on: [], off: [], toggle: [index], held: [] };
    } else if (isLight(this.step)) {
      this.#free(index);
      this.profile.lights[this.step] = [index];
    } else if (this.step === 'put_back') {
      this.#free(index);
      this.profile.put_back = [index];
    } else if (this.step === 'throttle' || this.step === 'brake') {
      const rest = this.#rest(kind, index);
      const full = farther(low, high, rest);
      this.profile[this.step] = { kind, index, min: Math.min(rest, full),
        max: Math.max(rest, full), invert: full < rest, deadzone: DEADZONE };
    }
  }

  /** Remove a button from its other functions: a calibrated button has only one. */
  #free(index: number) {
    const { reverse, lights, put_back } = this.profile;
    this.profile.put_back = put_back.filter((button) => button !== index);
    for (const group of [reverse, lights] as Record<string, number[]>[]) {
      for (const [name, buttons] of Object.entries(group)) {
        Object.assign(group, { [name]: buttons.filter((button) => button !== index) });
      }
    }
  }

  #steering(low: number, high: number): Control {
    const { kind, index, end: left, centre } = this.#left as LeftEnd;
    const right = farther(low, high, left);
    const [min, max] = [Math.min(left, right), Math.max(left, right)];
    const share = (centre - min) / (max - min);
    return { kind, index, min, max, centre: share > 0.3 && share < 0.7 ? centre : (min + max) / 2,
      invert: left > right, deadzone: DEADZONE };
  }

  #largest(): (Place & { span: number }) | null {
    let best: (Place & { span: number }) | null = null;
    const kinds: Kind[] = isButton(this.step) ? ['button'] : ['axis', 'button'];
    for (const kind of kinds) {
      for (const index of listOf(this.#sample, kind).keys()) {
        const span = valueOf(this.#high, kind, index) - valueOf(this.#low, kind, index);
        if (span > LEAST_SPAN && span > (best?.span ?? 0) && this.#isFree(kind, index)) {
          best = { kind, index, span };
        }
      }
    }
    return best;
  }

  #isFree(kind: Kind, index: number) {
    const { steering, throttle } = this.profile;
    const is = (control: Place | null) => control?.kind === kind && control.index === index;
    switch (this.step) {
      case 'left': return kind === 'axis';
      case 'right': return is(this.#left);
      case 'throttle': return !is(steering);
      // Both pedals of some wheels share one axis, one for each direction.
      case 'brake': return !is(steering) && (!is(throttle) || this.#isOpposite(throttle));
      default: return true;
    }
  }

  #isOpposite(throttle: Control) {
    const { kind, index } = throttle;
    const rest = throttle.invert ? throttle.max : throttle.min;
    const up = valueOf(this.#high, kind, index) - rest;
    const down = rest - valueOf(this.#low, kind, index);
    return throttle.invert ? up > down : down > up;
  }

  #isBack({ kind, index }: Place) {
    const low = valueOf(this.#low, kind, index);
    const high = valueOf(this.#high, kind, index);
    const rest = this.#rest(kind, index);
    const far = Math.abs(farther(low, high, rest) - rest);
    return Math.abs(valueOf(this.#sample, kind, index) - rest) < BACK_SHARE * far;
  }

  /** Return where a control stands at rest. */
  #rest(kind: Kind, index: number) {
    if (this.step === 'left' || this.step === 'right') {
      return valueOf(this.#centre, kind, index);
    }
    // Browsers report 0 for an axis that has not moved yet; a pedal's first true value is then
    // near the end where it rests.
    const start = valueOf(this.#start, kind, index);
    const first = valueOf(this.#first, kind, index);
    return kind === 'axis' && start === 0 && Math.abs(first) > MADE_UP ? Math.sign(first) : start;
  }
}

function isLight(step: CalibrationStep): step is keyof LightButtons {
  return LIGHT_BUTTONS.some((name) => name === step);
}

/** @returns whether it asks for a button */
function isButton(step: CalibrationStep): boolean {
  return step === 'reverse' || step === 'put_back' || isLight(step);
}

function listOf(sample: Sample | null, kind: Kind): number[] {
  return (kind === 'axis' ? sample?.axes : sample?.buttons) ?? [];
}

function valueOf(sample: Sample | null, kind: Kind, index: number) {
  return listOf(sample, kind)[index] ?? 0;
}

function farther(low: number, high: number, from: number) {
  return Math.abs(low - from) > Math.abs(high - from) ? low : high;
}

/** Combine samples value by value. */
function merged(combine: (...values: number[]) => number, ...samples: Sample[]): Sample {
  const last = samples.at(-1) as Sample;
  const each = (name: 'axes' | 'buttons') => last[name].map(
    (value, i) => combine(...samples.map((sample) => sample[name][i] ?? value)));
  return { axes: each('axes'), buttons: each('buttons') };
}
