// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The tone of a take-over request. */

// Two beeps an octave above the engine's loudest tones, audible to older drivers too [Hz, s].
const PITCHES = [880, 1320];
const BEEP_S = 0.12;
const APART_S = 0.18;
const PAIR_S = 0.7;
const PAIRS = 3;
const RISE_S = 0.008;
const LOUDEST = 0.4;

/** The tone of a request; browsers allow it after a first gesture on the page. */
export class RequestTone {
  #context: AudioContext | null = null;
  #sounding: OscillatorNode[] = [];

  constructor() {
    const begin = () => {
      this.#context ??= new AudioContext({ latencyHint: 'interactive' });
      if (this.#sounding.length === 0) {
        this.#context.suspend();
      }
      window.removeEventListener('keydown', begin, true);
      window.removeEventListener('pointerdown', begin, true);
    };
    window.addEventListener('keydown', begin, true);
    window.addEventListener('pointerdown', begin, true);
  }

  /** @param volume 0 to 1 */
  play(volume: number) {
    this.stop();
    const context = this.#context;
    if (context === null || volume <= 0) {
      return;
    }
    context.resume();
    const start = context.currentTime + 0.01;
    for (let pair = 0; pair < PAIRS; pair += 1) {
      PITCHES.forEach((pitch, i) => {
        this.#beep(context, pitch, start + pair * PAIR_S + i * APART_S, volume * LOUDEST);
      });
    }
  }

  /** Stop the tone. */
  stop() {
    for (const each of this.#sounding) {
      each.stop();
    }
    this.#sounding = [];
  }

  /** `pitch` [Hz]; `at`: time of the context [s]. */
  #beep(context: AudioContext, pitch: number, at: number, gain: number) {
    const tone = new OscillatorNode(context, { type: 'triangle', frequency: pitch });
    const level = new GainNode(context, { gain: 0 });
    level.gain.setValueAtTime(0, at);
    level.gain.linearRampToValueAtTime(gain, at + RISE_S);
    level.gain.setValueAtTime(gain, at + BEEP_S - RISE_S);
    level.gain.linearRampToValueAtTime(0, at + BEEP_S);
    tone.connect(level).connect(context.destination);
    tone.start(at);
    tone.stop(at + BEEP_S);
    tone.addEventListener('ended', () => {
      this.#sounding = this.#sounding.filter((each) => each !== tone);
      if (this.#sounding.length === 0) {
        context.suspend();
      }
    });
    this.#sounding.push(tone);
  }
}
