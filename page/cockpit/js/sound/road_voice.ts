// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The sound of the own motion: tyres, wind, squealing brakes, ground beside the road. */

import { cornering, hardBraking, roughness, tyreLevel, windLevel } from './levels.js';
import { makeFilter, makeGain, playNoise } from './voices.js';

import type { Driven } from './listener.js';
import type { Value } from './voices.js';

// One band of noise.
export interface Band {
  filters: [type: BiquadFilterType, frequency: number, q?: number][]; // one after another
  boost: number; // gain that compensates the power that the filters remove
  level: (own: Road) => number; // amplitude, 0 at standstill
}

export interface Road extends Pick<Driven, 'speed' | 'deceleration' | 'lateral'> {
  offRoad: boolean;
}

const BANDS: Band[] = [
  { filters: [['highpass', 70], ['lowpass', 420], ['lowpass', 700]], boost: 8,
    level: ({ speed }) => tyreLevel(speed) },
  { filters: [['highpass', 500], ['lowpass', 1800]], boost: 4,
    level: ({ speed }) => windLevel(speed) },
  { filters: [['bandpass', 2350, 40]], boost: 12,
    level: ({ deceleration, speed }) => 0.07 * hardBraking(deceleration, speed) },
  { filters: [['bandpass', 3310, 60]], boost: 14,
    level: ({ deceleration, speed }) => 0.04 * hardBraking(deceleration, speed) },
  { filters: [['bandpass', 940, 14]], boost: 8,
    level: ({ lateral, speed }) => 0.1 * cornering(lateral, speed) },
  { filters: [['lowpass', 130]], boost: 14,
    level: ({ speed, offRoad }) => (offRoad ? 0.16 * roughness(speed) : 0) },
  { filters: [['bandpass', 2600, 0.8]], boost: 2,
    level: ({ speed, offRoad }) => (offRoad ? 0.08 * roughness(speed) : 0) },
];

/** Noise in bands, at `output`. */
export class RoadVoice {
  output;
  #bands: { gain: Value; band: Band }[];

  constructor(context: BaseAudioContext, noise: AudioBuffer) {
    this.output = context.createGain();
    const source = playNoise(context, noise);
    this.#bands = BANDS.map((band) => {
      const { node, gain } = makeGain(context);
      let last: AudioNode = source;
      for (const [type, frequency, q] of band.filters) {
        last = last.connect(makeFilter(context, type, frequency, q));
      }
      last.connect(node).connect(this.output);
      return { gain, band };
    });
  }

  /** @param when time of the context [s] */
  update(own: Road, when: number) {
    for (const { gain, band } of this.#bands) {
      gain.to(band.boost * band.level(own), when);
    }
  }
}
