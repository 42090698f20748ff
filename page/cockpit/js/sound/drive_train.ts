// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The speed of an engine or motor at a road speed, and the choice of the gear. */

/** The drive train between engine and road. */
export interface DriveTrain {
  name: 'car' | 'heavy' | 'electric' | 'muscle';
  ratios: number[]; // of the gears, in order
  reverse_ratio: number;
  final_drive: number;
  wheel_radius_m: number;
  idle_rpm: number; // 0 for a motor that stands with its wheels
  limit_rpm: number;
  order: number; // of the strongest tone: tone = turns per second * order
}

/** Four cylinders, four strokes: two firings a turn. Six gears of a ZF 6HP automatic gearbox. */
export const CAR: DriveTrain = Object.freeze({
  name: 'car', ratios: [4.171, 2.34, 1.521, 1.143, 0.867, 0.691], reverse_ratio: 3.403,
  final_drive: 3.46, wheel_radius_m: 0.31, idle_rpm: 800, limit_rpm: 6500, order: 2,
});

/** A lorry's or bus's Diesel: six cylinders, three firings a turn, twelve evenly spaced gears. */
export const HEAVY: DriveTrain = Object.freeze({
  name: 'heavy', ratios: Array.from({ length: 12 }, (_, gear) => 14.94 ** (1 - gear / 11)),
  reverse_ratio: 14.0, final_drive: 2.6, wheel_radius_m: 0.5, idle_rpm: 600, limit_rpm: 2200,
  order: 3,
});

/** A motor of four pole pairs behind one reduction: its torque pulses eight times a turn. */
export const ELECTRIC: DriveTrain = Object.freeze({
  name: 'electric', ratios: [1], reverse_ratio: 1, final_drive: 9.0, wheel_radius_m: 0.31,
  idle_rpm: 0, limit_rpm: 14000, order: 8,
});

/** A rider: what a bicycle sounds like is its tyres. */
export const MUSCLE: DriveTrain = Object.freeze({
  name: 'muscle', ratios: [1], reverse_ratio: 1, final_drive: 1, wheel_radius_m: 0.34,
  idle_rpm: 0, limit_rpm: 420, order: 1,
});

// Where gears change, as shares of the way from idling to the limit: at a released pedal, and
// what a floored one adds. Whatever the throttle, a change up ends above where it changes down.
const UP = { released: 0.25, floored: 0.55 };
const DOWN = { released: 0.06, floored: 0.25 };
// How far a slipping clutch holds the engine above idling in first gear at full throttle.
const LAUNCH = 0.2;

export const REVERSE = -1;

/**
 * @param gear index of a ratio, or REVERSE
 * @param speed of the road, without a sign [m/s]
 * @returns engine speed if it were locked to the wheels [rpm]
 */
export function lockedSpeed_rpm(train: DriveTrain, gear: number, speed: number): number {
  const ratio = gear === REVERSE ? train.reverse_ratio : train.ratios[gear];
  return speed / train.wheel_radius_m * ratio * train.final_drive * 60 / (2 * Math.PI);
}

/**
 * @param gear index of a ratio, or REVERSE
 * @param speed without a sign [m/s]
 * @param throttle 0 to 1
 * @returns engine speed: locked to the wheels, but at least idling; in the lowest gears more while
 *   the clutch slips [rpm]
 */
export function engineSpeed_rpm(train: DriveTrain, gear: number, speed: number,
  throttle: number): number {
  const slipping = gear <= 0 ? LAUNCH * throttle * (train.limit_rpm - train.idle_rpm) : 0;
  const least = train.idle_rpm === 0 ? 0 : train.idle_rpm + slipping;
  return Math.min(Math.max(lockedSpeed_rpm(train, gear, speed), least), train.limit_rpm);
}

/**
 * Choose the gear: up where the engine turns too fast for the throttle, down where too slowly.
 * @param gear that is in
 * @param speed without a sign [m/s]
 * @param throttle 0 to 1
 * @returns index of a ratio
 */
export function gearAfter(train: DriveTrain, gear: number, speed: number,
  throttle: number): number {
  const rpm = (
    { released, floored }: { released: number; floored: number }): number => train.idle_rpm
    + (train.limit_rpm - train.idle_rpm) * (released + floored * throttle);
  let next = Math.max(gear, 0);
  while (next + 1 < train.ratios.length && lockedSpeed_rpm(train, next, speed) > rpm(UP)) {
    next += 1;
  }
  while (next > 0 && lockedSpeed_rpm(train, next, speed) < rpm(DOWN)) {
    next -= 1;
  }
  return next;
}

/** Return the strongest tone [Hz]; `rpm` of the engine. */
export function tone_Hz(train: DriveTrain, rpm: number): number {
  return rpm / 60 * train.order;
}

/** Return 0 at idling, 1 at the limit; `rpm` of the engine. */
export function speedShare(train: DriveTrain, rpm: number): number {
  return (rpm - train.idle_rpm) / (train.limit_rpm - train.idle_rpm);
}
