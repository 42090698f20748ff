// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Building blocks of voices: smooth values, noise, waves. */

import type { DriveTrain } from './drive_train.js';

// Time constant of a voice's values: it avoids clicks and audible lag [s].
const SETTLE_S = 0.025;
const NOISE_S = 3;
// A smaller change is inaudible and causes no event.
const SAME = 2e-4;
const PARTIALS = 128;

/** One value of an audio node, moved smoothly. */
export class Value {
  #param;
  #settle_s;
  #last;

  /** @param settle_s time constant [s] */
  constructor(param: AudioParam, initial: number, settle_s = SETTLE_S) {
    this.#param = param;
    this.#settle_s = settle_s;
    this.#last = initial;
    param.value = initial;
  }

  /** Move to a value from a time on; `when`: time of the context [s]. */
  to(value: number, when: number) {
    if (Math.abs(value - this.#last) > SAME * Math.abs(this.#last)) {
      this.#param.setTargetAtTime(value, when, this.#settle_s);
      this.#last = value;
    }
  }

  /** Jump to a value, for a voice that is silent; `when`: time of the context [s]. */
  jump(value: number, when: number) {
    this.#param.cancelScheduledValues(when);
    this.#param.setValueAtTime(value, when);
    this.#last = value;
  }
}

/** Make a gain that begins in silence and moves smoothly. */
export function makeGain(context: BaseAudioContext): { node: GainNode; gain: Value } {
  const node = context.createGain();
  return { node, gain: new Value(node.gain, 0) };
}

/** @param frequency [Hz] */
export function makeFilter(context: BaseAudioContext, type: BiquadFilterType, frequency: number,
  q = Math.SQRT1_2): BiquadFilterNode {
  const filter = context.createBiquadFilter();
  filter.type = type;
  filter.frequency.value = frequency;
  filter.Q.value = q;
  return filter;
}

/** Make some seconds of white noise, the same every time, of variance 1/3. */
export function makeNoise(context: BaseAudioContext): AudioBuffer {
  const buffer = context.createBuffer(1, NOISE_S * context.sampleRate, context.sampleRate);
  const samples = buffer.getChannelData(0);
  // A linear congruential generator (Numerical Recipes): only its upper bits are used.
  let state = 1;
  for (let i = 0; i < samples.length; i += 1) {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    samples[i] = state / 2 ** 31 - 1;
  }
  return buffer;
}

/**
 * Play noise without end.
 * @param offset_s start in the noise: two players of one noise must differ
 */
export function playNoise(context: BaseAudioContext, noise: AudioBuffer,
  offset_s = 0): AudioBufferSourceNode {
  const source = context.createBufferSource();
  source.buffer = noise;
  source.loop = true;
  source.start(0, offset_s);
  return source;
}

/**
 * Return the partial of an engine's wave that is its strongest tone: a four-stroke engine repeats
 * every two turns, a motor with every pulse.
 * @returns number of the partial
 */
export function mainPartial(train: DriveTrain): number {
  return train.name === 'electric' ? 1 : 2 * train.order;
}

/**
 * Make the wave of an engine: the strongest tone and its multiples, weaker ones between them.
 * @param falling exponent with which the partials fall: less is harsher
 * @returns of amplitude 1
 */
export function engineWave(context: BaseAudioContext, train: DriveTrain,
  falling: number): PeriodicWave {
  const main = mainPartial(train);
  const real = new Float32Array(PARTIALS + 1);
  const imag = new Float32Array(PARTIALS + 1);
  for (let k = 1; k <= PARTIALS; k += 1) {
    const kind = main === 1 ? k % 2 : k % main === 0 ? 1 : k % (main / 2) === 0 ? 0.3 : 0.12;
    const amplitude = k < main ? 0.8 * kind * k / main : kind * (k / main) ** -falling;
    // Evenly spread phases keep the crest factor low (Schroeder 1970).
    const phase = Math.PI * k * k / PARTIALS;
    real[k] = amplitude * Math.cos(phase);
    imag[k] = amplitude * Math.sin(phase);
  }
  return context.createPeriodicWave(real, imag);
}
