// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Short sounds: the click of a relay, a kerb, a collision. */

import { makeFilter } from './voices.js';

// Rise time, so that no sound begins with a step [s].
const ATTACK_S = 0.002;
// Time constants until an exponential has fallen to a thousandth.
const TIME_CONSTANTS = 7;

/** Short sounds, connected to a given node. */
export class Strikes {
  #context;
  #noise;
  #out;

  constructor(context: BaseAudioContext, noise: AudioBuffer, out: AudioNode) {
    this.#context = context;
    this.#noise = noise;
    this.#out = out;
  }

  /**
   * Play the relay of an indicator.
   * @param lit whether its lamps go on, which sounds higher
   * @param when time of the context [s]
   */
  click(lit: boolean, when: number) {
    this.#burst(when, 0.5, 0.006, makeFilter(this.#context, 'bandpass', lit ? 2900 : 2200, 3));
  }

  /** Play wheels that cross a kerb; `strength`: 0 to 1; `when`: time of the context [s]. */
  kerb(strength: number, when: number) {
    this.#thump(when, 0.45 * strength, 0.05, 75);
    this.#burst(when, 0.25 * strength, 0.03, makeFilter(this.#context, 'lowpass', 700));
  }

  /** Play a collision; `strength`: 0 to 1; `when`: time of the context [s]. */
  collision(strength: number, when: number) {
    this.#thump(when, 0.9 * strength, 0.12, 55);
    this.#burst(when, 1.2 * strength, 0.09, makeFilter(this.#context, 'lowpass', 1500));
    this.#burst(when + 0.03, 0.4 * strength, 0.22, makeFilter(this.#context, 'bandpass', 3200, 2));
  }

  /** `when` [s]; `decay_s`: time constant [s]. */
  #burst(when: number, amplitude: number, decay_s: number, filter: BiquadFilterNode) {
    const source = this.#context.createBufferSource();
    source.buffer = this.#noise;
    source.connect(filter).connect(this.#envelope(source, when, amplitude, decay_s));
    source.start(when);
    source.stop(when + TIME_CONSTANTS * decay_s);
  }

  /** `when` [s]; `decay_s`: time constant [s]; `frequency`: at which it begins, and falls [Hz]. */
  #thump(when: number, amplitude: number, decay_s: number, frequency: number) {
    const source = this.#context.createOscillator();
    source.frequency.setValueAtTime(frequency, when);
    source.frequency.setTargetAtTime(0.5 * frequency, when, decay_s);
    source.connect(this.#envelope(source, when, amplitude, decay_s));
    source.start(when);
    source.stop(when + TIME_CONSTANTS * decay_s);
  }

  /** `source`: stopped at its end; `when` [s]. */
  #envelope(source: AudioScheduledSourceNode, when: number, amplitude: number,
    decay_s: number): GainNode {
    const level = this.#context.createGain();
    level.gain.setValueAtTime(0, when);
    level.gain.linearRampToValueAtTime(amplitude, when + ATTACK_S);
    level.gain.setTargetAtTime(0, when + ATTACK_S, decay_s);
    level.connect(this.#out);
    source.onended = () => level.disconnect();
    return level;
  }
}
