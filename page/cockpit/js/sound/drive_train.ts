// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The speed of an engine or motor at a road speed, and the choice of the gear. */

/**
 * The drive train between engine and road.
 *
 * @typedef {object} DriveTrain
 * @property {'car'|'heavy'|'electric'|'muscle'} name
 * @property {number[]} ratios of the gears, in order
 * @property {number} reverse_ratio
 * @property {number} final_drive
 * @property {number} wheel_radius_m
 * @property {number} idle_rpm 0 for a motor that stands with its wheels
 * @property {number} limit_rpm
 * @property {number} order of the strongest tone:
 *   tone = turns per second * order
 */

/**
 * Four cylinders, four strokes: two firings a turn. Six gears of a ZF 6HP automatic gearbox.
 *
 * @type {DriveTrain}
 */
export const CAR = Object.freeze({
  name: 'car', ratios: [4.171, 2.34, 1.521, 1.143, 0.867, 0.691], reverse_ratio: 3.403,
  final_drive: 3.46, wheel_radius_m: 0.31, idle_rpm: 800, limit_rpm: 6500, order: 2,
});

/**
 * A lorry's or bus's Diesel: six cylinders, three firings a turn, twelve evenly spaced gears.
 *
 * @type {DriveTrain}
 */
export const HEAVY = Object.freeze({
  name: 'heavy', ratios: Array.from({ length: 12 }, (_, gear) => 14.94 ** (1 - gear / 11)),
  reverse_ratio: 14.0, final_drive: 2.6, wheel_radius_m: 0.5, idle_rpm: 600, limit_rpm: 2200,
  order: 3,
});

/**
 * A motor of four pole pairs behind one reduction: its torque pulses eight times a turn.
 *
 * @type {DriveTrain}
 */
export const ELECTRIC = Object.freeze({
  name: 'electric', ratios: [1], reverse_ratio: 1, final_drive: 9.0, wheel_radius_m: 0.31,
  idle_rpm: 0, limit_rpm: 14000, order: 8,
});

/**
 * A rider: what a bicycle sounds like is its tyres.
 *
 * @type {DriveTrain}
 */
export const MUSCLE = Object.freeze({
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
 * @param {DriveTrain} train
 * @param {number} gear index of a ratio, or REVERSE
 * @param {number} speed of the road, without a sign [m/s]
 * @returns {number} engine speed if it were locked to the wheels [rpm]
 */
export function lockedSpeed_rpm(train, gear, speed) {
  const ratio = gear === REVERSE ? train.reverse_ratio : train.ratios[gear];
  return speed / train.wheel_radius_m * ratio * train.final_drive * 60 / (2 * Math.PI);
}

/**
 * @param {DriveTrain} train
 * @param {number} gear index of a ratio, or REVERSE
 * @param {number} speed without a sign [m/s]
 * @param {number} throttle 0 to 1
 * @returns {number} engine speed: locked to the wheels, but at least idling; in the lowest
 *   gears more while the clutch slips [rpm]
 */
export function engineSpeed_rpm(train, gear, speed, throttle) {
  const slipping = gear <= 0 ? LAUNCH * throttle * (train.limit_rpm - train.idle_rpm) : 0;
  const least = train.idle_rpm === 0 ? 0 : train.idle_rpm + slipping;
  return Math.min(Math.max(lockedSpeed_rpm(train, gear, speed), least), train.limit_rpm);
}

/**
 * Choose the gear: up where the engine turns too fast for the throttle, down where too slowly.
 *
 * @param {DriveTrain} train
 * @param {number} gear that is in
 * @param {number} speed without a sign [m/s]
 * @param {number} throttle 0 to 1
 * @returns {number} index of a ratio
 */
export function gearAfter(train, gear, speed, throttle) {
  /** @type {(share: {released: number, floored: number}) => number} */
  const rpm = ({ released, floored }) => train.idle_rpm
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

/**
 * @param {DriveTrain} train
 * @param {number} rpm of the engine
 * @returns {number} its strongest tone [Hz]
 */
export function tone_Hz(train, rpm) {
  return rpm / 60 * train.order;
}

/**
 * @param {DriveTrain} train
 * @param {number} rpm of the engine
 * @returns {number} 0 at idling, 1 at the limit
 */
export function speedShare(train, rpm) {
  return (rpm - train.idle_rpm) / (train.limit_rpm - train.idle_rpm);
}
