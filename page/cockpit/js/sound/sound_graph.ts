// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * All sounds as one graph of audio nodes, for speakers or for an offline context.
 *
 * voices -> mix -> compressor -> clipper -> gate (volume, silence) -> out. The clipper's curve
 * ends below 1, and the gate gives at most 1: no sample is ever beyond full scale.
 */

import { LIGHT, shining } from '../lights.js';
import { EngineVoice } from './engine_voice.js';
import { Horn } from './horn.js';
import { impact } from './levels.js';
import { MOST_OTHERS } from './listener.js';
import { OtherVoice } from './other_voice.js';
import { RoadVoice } from './road_voice.js';
import { Strikes } from './strikes.js';
import { makeNoise } from './voices.js';

import type { Heard, Other } from './listener.js';

const THRESHOLD_dB = -8;
const RATIO = 12;
// Input and output of the clipper: linear up to the knee, then increasingly flat.
const CLIP_RANGE = 4;
const KNEE = 0.8;
const CEILING = 0.98;
const FADE_S = 0.04;

/** State of the own vehicle; kerb: strength of a kerb just crossed, 0 to 1. */
export interface Trouble { collision: boolean; offRoad: boolean; kerb: number }

/** The graph; silent until `open`. */
export class SoundGraph {
  #context;
  #mix;
  #gate;
  #engine;
  #road;
  #horn;
  #strikes;
  #others;
  #trouble: Trouble | null = null;
  #lit = false;
  #fading = { from: 0, to: 0, at: 0 };

  constructor(context: BaseAudioContext) {
    this.#context = context;
    const noise = makeNoise(context);
    // Always two channels, so that a passing vehicle does not change the channel count.
    this.#mix = new GainNode(context, { channelCount: 2, channelCountMode: 'explicit' });
    this.#gate = context.createGain();
    this.#gate.gain.value = 0;
    this.#limit().connect(this.#gate).connect(context.destination);
    this.#engine = new EngineVoice(context);
    this.#road = new RoadVoice(context, noise);
    this.#horn = new Horn(context, this.#mix);
    this.#strikes = new Strikes(context, noise, this.#mix);
    this.#engine.output.connect(this.#mix);
    this.#road.output.connect(this.#mix);
    this.#others = Array.from({ length: 2 * MOST_OTHERS },
      (_, number) => new OtherVoice(context, noise, this.#mix, number));
  }

  /** Fade to a gain, 0 to 1; `when`: time of the context [s]. */
  open(gain: number, when: number) {
    const { gain: param } = this.#gate;
    const { from, to, at } = this.#fading;
    const now = from + (to - from) * Math.min(Math.max((when - at) / FADE_S, 0), 1);
    this.#fading = { from: now, to: gain, at: when };
    param.cancelScheduledValues(when);
    param.setValueAtTime(now, when);
    param.linearRampToValueAtTime(gain, when + FADE_S);
  }

  /**
   * Fade to silence, which is exact after a moment.
   * @param when time of the context [s]
   * @returns time from which it is silent [s]
   */
  hush(when: number): number {
    this.open(0, when);
    // Events during the silence are dropped.
    this.#trouble = null;
    this.#horn.update(false, 1, when);
    return when + FADE_S;
  }

  /** Set the sounds from a time on; `when`: time of the context [s]. */
  update({ t, own, others }: Heard, trouble: Trouble, when: number) {
    this.#engine.update(own, when);
    this.#road.update({ ...own, offRoad: trouble.offRoad }, when);
    this.#horn.update((own.lights & LIGHT.horn) !== 0, 1, when);
    this.#blink(own.lights, t, when);
    this.#strike(trouble, own.speed, when);
    this.#lend(others, when);
  }

  /** @param t simulation time [s] */
  #blink(lights: number, t: number, when: number) {
    const { left, right } = shining(lights, t);
    if ((left || right) !== this.#lit) {
      this.#lit = left || right;
      this.#strikes.click(this.#lit, when);
    }
  }

  /** @param speed [m/s] */
  #strike(trouble: Trouble, speed: number, when: number) {
    const before = this.#trouble ?? trouble;
    const edge = trouble.offRoad !== before.offRoad ? 1 : trouble.kerb;
    if (edge > 0) {
      this.#strikes.kerb(edge * impact(speed), when);
    }
    if (trouble.collision && !before.collision) {
      this.#strikes.collision(impact(speed), when);
    }
    this.#trouble = trouble;
  }

  #lend(others: Other[], when: number) {
    const near = new Set(others.map(({ id }) => id));
    for (const voice of this.#others) {
      if (!near.has(voice.id)) {
        voice.release(when);
      }
    }
    for (const other of others) {
      const voice = this.#others.find(({ id }) => id === other.id)
        ?? this.#others.find((free) => free.isFree(when));
      voice?.update(other, when);
    }
  }

  /** @returns nodes that limit the mix to a safe level */
  #limit(): AudioNode {
    const context = this.#context;
    const compressor = new DynamicsCompressorNode(context, {
      threshold: THRESHOLD_dB, knee: 0, ratio: RATIO, attack: 0.002, release: 0.2,
    });
    // A compressor applies make-up gain (Web Audio API 1.1, 1.19.5). This is undone, so that
    // sounds below the threshold stay unchanged.
    const undo = context.createGain();
    undo.gain.value = 10 ** (0.6 * THRESHOLD_dB * (1 - 1 / RATIO) / 20) / CLIP_RANGE;
    const clipper = context.createWaveShaper();
    clipper.curve = clipCurve();
    this.#mix.connect(compressor).connect(undo).connect(clipper);
    return clipper;
  }
}

/** @returns of an odd number of points, so that silence stays silence */
function clipCurve(): Float32Array<ArrayBuffer> {
  const points = 4097;
  return Float32Array.from({ length: points }, (_, i) => {
    const x = CLIP_RANGE * (2 * i / (points - 1) - 1);
    const above = Math.max(Math.abs(x) - KNEE, 0);
    const size = Math.min(Math.abs(x), KNEE)
      + (CEILING - KNEE) * Math.tanh(above / (CEILING - KNEE));
    return Math.sign(x) * size;
  });
}
