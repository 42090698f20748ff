// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The engine of the own vehicle: two waves, calm and harsh, mixed by the load. */

import { tone_Hz } from './drive_train.js';
import { engineLevel } from './levels.js';
import { engineWave, mainPartial, makeFilter, Value } from './voices.js';

import type { DriveTrain } from './drive_train.js';
import type { Driven } from './listener.js';

const CALM = 1.7;
const HARSH = 0.7;
// Time constant of the engine speed, which does not jump when a gear changes [s].
const INERTIA_S = 0.06;
const LOAD_S = 0.08;

/** The sound of one engine, at `output`. */
export class EngineVoice {
  output;
  #context;
  #calm;
  #harsh;
  #filter;
  #frequencies: Value[];
  #cutoff;
  #calmGain;
  #harshGain;
  #train: DriveTrain | null = null;

  constructor(context: BaseAudioContext) {
    this.#context = context;
    this.#calm = context.createOscillator();
    this.#harsh = context.createOscillator();
    const calm = context.createGain();
    const harsh = context.createGain();
    this.#calmGain = new Value(calm.gain, 0, LOAD_S);
    this.#harshGain = new Value(harsh.gain, 0, LOAD_S);
    this.#filter = makeFilter(context, 'lowpass', 400);
    this.#cutoff = new Value(this.#filter.frequency, 400, INERTIA_S);
    this.#frequencies = [this.#calm, this.#harsh].map(
      (oscillator) => new Value(oscillator.frequency, 0, INERTIA_S));
    this.#calm.connect(calm).connect(this.#filter);
    this.#harsh.connect(harsh).connect(this.#filter);
    this.#calm.start();
    this.#harsh.start();
    this.output = this.#filter;
  }

  /** @param when time of the context [s] */
  update({ train, rpm, load }: Pick<Driven, 'train' | 'rpm' | 'load'>, when: number) {
    const frequency = tone_Hz(train, rpm) / mainPartial(train);
    if (train !== this.#train) {
      // After a change of the vehicle there is a moment of silence: `SoundGraph.hush`.
      this.#train = train;
      this.#calm.setPeriodicWave(engineWave(this.#context, train, CALM));
      this.#harsh.setPeriodicWave(engineWave(this.#context, train, HARSH));
      this.#frequencies.forEach((value) => value.jump(frequency, when));
    }
    const level = engineLevel(train, rpm, load);
    this.#frequencies.forEach((value) => value.to(frequency, when));
    this.#calmGain.to(level * (1 - 0.8 * load), when);
    this.#harshGain.to(level * 0.8 * load, when);
    this.#cutoff.to(train.name === 'electric' ? 6000 : 250 + 0.25 * rpm * (0.6 + load), when);
  }
}
