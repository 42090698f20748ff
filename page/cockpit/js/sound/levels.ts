// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * Loudness of the sounds that a driver hears, as amplitudes before the volume: 1 is full scale.
 *
 * The exponents are those of vehicle acoustics: the power of tyre noise grows with 35 dB per
 * decade of speed (30 to 40: Sandberg and Ejsmont, Tyre/Road Noise Reference Book, 2002), that of
 * wind with 60 dB (a dipole's, with the sixth power of speed: Curle 1955).
 */

import { speedShare } from './drive_train.js';

import type { DriveTrain } from './drive_train.js';

const TYRES = { amplitude: 0.07, at: 30, exponent: 1.75 };
const WIND = { amplitude: 0.06, at: 40, exponent: 3 };
const LOUDEST_WIND = 0.2;
// Decelerations at which brakes begin to squeal and are loudest [m/s^2].
const SQUEAL_FROM = 5;
const SQUEAL_FULL = 8;
// Lateral accelerations at which tyres begin to squeal and are loudest [m/s^2].
const SCREECH_FROM = 6;
const SCREECH_FULL = 9;
// Slower than this, brakes and tyres are silent [m/s].
const CREEP = 2;

/**
 * @param rpm of the engine
 * @param load 0 to 1
 * @returns amplitude of an engine in its vehicle; of a motor 0 at standstill, of a rider always
 */
export function engineLevel(train: DriveTrain, rpm: number, load: number): number {
  const share = speedShare(train, rpm);
  return train.name === 'muscle' ? 0 : train.name === 'electric'
    ? 0.09 * Math.min(rpm / 400, 1) * (0.3 + 0.7 * load) * (0.5 + 0.5 * share)
    : 0.07 + 0.16 * share + 0.12 * load * (0.35 + 0.65 * share);
}

/** Return the amplitude of rolling tyres; `speed` without a sign [m/s]. */
export function tyreLevel(speed: number): number {
  return TYRES.amplitude * (speed / TYRES.at) ** TYRES.exponent;
}

/** Return the amplitude of wind; `speed` without a sign [m/s]. */
export function windLevel(speed: number): number {
  return Math.min(WIND.amplitude * (speed / WIND.at) ** WIND.exponent, LOUDEST_WIND);
}

/** Return 0 to 1; `deceleration`: against the motion [m/s^2]; `speed` without a sign [m/s]. */
export function hardBraking(deceleration: number, speed: number): number {
  return smooth(deceleration, SQUEAL_FROM, SQUEAL_FULL) * smooth(speed, 0, CREEP);
}

/** Return 0 to 1; `lateral`: acceleration [m/s^2]; `speed` without a sign [m/s]. */
export function cornering(lateral: number, speed: number): number {
  return smooth(Math.abs(lateral), SCREECH_FROM, SCREECH_FULL) * smooth(speed, 0, CREEP);
}

/** Return the roughness of the ground beside the road, 0 to 1; `speed` without a sign [m/s]. */
export function roughness(speed: number): number {
  return smooth(speed, 0, 15);
}

/** Return the strength of a collision, 0 to 1; `speed` without a sign [m/s]. */
export function impact(speed: number): number {
  return 0.35 + 0.65 * smooth(speed, 0, 15);
}

/**
 * @param volume as people set it, 0 to 1
 * @returns gain: perceived loudness is closer to the square root of amplitude
 */
export function volumeGain(volume: number): number {
  return volume * volume;
}

/** `from`: below it the result is 0; `to`: above it the result is 1. */
function smooth(value: number, from: number, to: number) {
  const share = Math.min(Math.max((value - from) / (to - from), 0), 1);
  return share * share * (3 - 2 * share);
}
