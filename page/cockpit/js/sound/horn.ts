// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A horn with the two notes of a car, whose nodes exist only while it sounds. */

import { makeFilter, Value } from './voices.js';

/** Frequencies of the two notes [Hz]. */
const NOTES_Hz = Object.freeze([420, 500]);
const AMPLITUDE = 0.14;
const ATTACK_S = 0.015;
const GONE_S = 0.2;

/** One horn, connected to a given node. */
export class Horn {
  #context;
  #out;
  #sounding: { oscillators: OscillatorNode[]; pitches: Value[]; gain: Value } | null = null;

  constructor(context: BaseAudioContext, out: AudioNode) {
    this.#context = context;
    this.#out = out;
  }

  /** `doppler` by which the notes are shifted; `when`: time of the context [s]. */
  update(on: boolean, doppler: number, when: number) {
    if (on && this.#sounding === null) {
      this.#sounding = this.#begin(doppler, when);
    } else if (!on && this.#sounding !== null) {
      this.#sounding.gain.to(0, when);
      this.#sounding.oscillators.forEach((oscillator) => oscillator.stop(when + GONE_S));
      this.#sounding = null;
    }
    this.#sounding?.pitches.forEach((pitch, i) => pitch.to(NOTES_Hz[i] * doppler, when));
  }

  #begin(doppler: number, when: number) {
    const level = this.#context.createGain();
    const gain = new Value(level.gain, 0, ATTACK_S);
    const filter = makeFilter(this.#context, 'lowpass', 3000);
    filter.connect(level).connect(this.#out);
    const oscillators = NOTES_Hz.map(() => this.#context.createOscillator());
    const pitches = oscillators.map((oscillator, i) => {
      oscillator.type = 'sawtooth';
      oscillator.connect(filter);
      oscillator.start(when);
      return new Value(oscillator.frequency, NOTES_Hz[i] * doppler);
    });
    oscillators[0].onended = () => level.disconnect();
    gain.to(AMPLITUDE, when);
    return { oscillators, pitches, gain };
  }
}
