// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The sound of a passing vehicle: engine, tyres and horn, with pan, distance and Doppler. */

import { LIGHT } from '../lights.js';
import { tone_Hz } from './drive_train.js';
import { attenuation } from './hearing.js';
import { Horn } from './horn.js';
import { engineLevel, tyreLevel } from './levels.js';
import { engineWave, mainPartial, makeFilter, makeGain, playNoise, Value } from './voices.js';

import type { Other } from './listener.js';

// Factors outside against inside: tyres are louder and engines quieter.
const TYRES = 14;
const ENGINE = 1.2;
const LOAD = 0.4;
// Largest pan: a sound from one side is heard with both ears.
const ASIDE = 0.85;
const BAND_Hz = 750;
// Cut-off of the treble that a cabin lets in.
const CABIN_Hz = 2200;
const FADE_S = 0.05;
const GONE_S = 0.4;

/** A voice for another vehicle, assigned to one that is near. */
export class OtherVoice {
  /** Id of its vehicle; empty while it is free. */
  id = '';
  #context;
  #noise;
  #out;
  #engine;
  #tyres;
  #horn;
  #frequency;
  #engineGain;
  #tyreGain;
  #rate;
  #level;
  #pan;
  #panner;
  #train = '';
  #freeAt = 0;
  #connected = false;

  /** `out`: node that it is connected to while it is in use; `number` of this voice. */
  constructor(context: BaseAudioContext, noise: AudioBuffer, out: AudioNode, number: number) {
    this.#context = context;
    this.#out = out;
    this.#engine = context.createOscillator();
    this.#frequency = new Value(this.#engine.frequency, 0);
    this.#noise = playNoise(context, noise, 0.4 * (number + 1));
    this.#rate = new Value(this.#noise.playbackRate, 1);
    const cabin = makeFilter(context, 'lowpass', CABIN_Hz);
    const engine = makeGain(context);
    const tyres = makeGain(context);
    const level = context.createGain();
    this.#engineGain = engine.gain;
    this.#tyreGain = tyres.gain;
    this.#level = new Value(level.gain, 0, FADE_S);
    this.#panner = context.createStereoPanner();
    this.#pan = new Value(this.#panner.pan, 0);
    this.#tyres = makeFilter(context, 'bandpass', BAND_Hz, 0.6);
    this.#engine.connect(engine.node).connect(cabin);
    this.#noise.connect(this.#tyres).connect(tyres.node).connect(cabin);
    this.#horn = new Horn(context, cabin);
    cabin.connect(level).connect(this.#panner);
    this.#engine.start();
  }

  /** Return whether it is free; `when`: time of the context [s]. */
  isFree(when: number): boolean {
    return this.id === '' && when >= this.#freeAt;
  }

  /** @param when time of the context [s] */
  update({ id, train, rpm, speed, distance, pan, doppler, lights }: Other, when: number) {
    const frequency = doppler * tone_Hz(train, rpm) / mainPartial(train);
    if (id !== this.id) {
      this.id = id;
      this.#begin(frequency, doppler, ASIDE * pan, when);
    }
    if (train.name !== this.#train) {
      this.#train = train.name;
      this.#engine.setPeriodicWave(engineWave(this.#context, train, 1.3));
    }
    this.#frequency.to(frequency, when);
    this.#rate.to(doppler, when);
    this.#engineGain.to(ENGINE * engineLevel(train, rpm, LOAD), when);
    this.#tyreGain.to(TYRES * tyreLevel(speed), when);
    this.#horn.update((lights & LIGHT.horn) !== 0, doppler, when);
    this.#pan.to(ASIDE * pan, when);
    this.#level.to(attenuation(distance), when);
  }

  /** Fade out and free the voice; `when`: time of the context [s]. */
  release(when: number) {
    if (this.id !== '') {
      this.id = '';
      this.#horn.update(false, 1, when);
      this.#level.to(0, when);
      this.#freeAt = when + GONE_S;
    } else if (this.#connected && when >= this.#freeAt) {
      // A disconnected voice costs nothing.
      this.#panner.disconnect();
      this.#connected = false;
    }
  }

  /** @param frequency [Hz] */
  #begin(frequency: number, doppler: number, pan: number, when: number) {
    if (!this.#connected) {
      this.#panner.connect(this.#out);
      this.#connected = true;
    }
    // A new vehicle is silent at first, so its values need not glide.
    this.#level.jump(0, when);
    this.#frequency.jump(frequency, when);
    this.#rate.jump(doppler, when);
    this.#pan.jump(pan, when);
  }
}
