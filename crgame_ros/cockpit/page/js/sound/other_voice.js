// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Somebody who passes by: engine, tyres and horn, from a side, from afar, shifted in pitch. */

import { LIGHT } from '../lights.js';
import { tone_Hz } from './drive_train.js';
import { attenuation } from './hearing.js';
import { Horn } from './horn.js';
import { engineLevel, tyreLevel } from './levels.js';
import { engineWave, mainPartial, makeFilter, makeGain, playNoise, Value } from './voices.js';

/** @import { Other } from './listener.js' */

// Outside, tyres are louder, and engines little, beside what each is inside.
const TYRES = 14;
const ENGINE = 1.2;
const LOAD = 0.4;
// One hears with both ears what is at one side.
const ASIDE = 0.85;
const BAND_Hz = 750;
// How much of the treble a cabin lets in.
const CABIN_Hz = 2200;
const FADE_S = 0.05;
const GONE_S = 0.4;

/** One of the others that are heard; lent to whoever is near. */
export class OtherVoice {
  /** Id of whom it is; empty while nobody is. */
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

  /**
   * @param {BaseAudioContext} context
   * @param {AudioBuffer} noise
   * @param {AudioNode} out what it is heard at, while it is somebody
   * @param {number} number of this voice
   */
  constructor(context, noise, out, number) {
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

  /**
   * @param {number} when time of the context [s]
   * @returns {boolean} whether it can be lent
   */
  isFree(when) {
    return this.id === '' && when >= this.#freeAt;
  }

  /**
   * @param {Other} other
   * @param {number} when time of the context [s]
   */
  update({ id, train, rpm, speed, distance, pan, doppler, lights }, when) {
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

  /**
   * Fade out: it is nobody from now on.
   *
   * @param {number} when time of the context [s]
   */
  release(when) {
    if (this.id !== '') {
      this.id = '';
      this.#horn.update(false, 1, when);
      this.#level.to(0, when);
      this.#freeAt = when + GONE_S;
    } else if (this.#connected && when >= this.#freeAt) {
      // What is connected to nothing costs nothing.
      this.#panner.disconnect();
      this.#connected = false;
    }
  }

  /**
   * @param {number} frequency [Hz]
   * @param {number} doppler
   * @param {number} pan
   * @param {number} when
   */
  #begin(frequency, doppler, pan, when) {
    if (!this.#connected) {
      this.#panner.connect(this.#out);
      this.#connected = true;
    }
    // Whoever comes is silent at first: nothing has to glide to where they are.
    this.#level.jump(0, when);
    this.#frequency.jump(frequency, when);
    this.#rate.jump(doppler, when);
    this.#pan.jump(pan, when);
  }
}
