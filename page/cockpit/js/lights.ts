// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Lights and horn of a vehicle: the column `lights` of its state, or a recorded one's signals. */

/** Bits; both indicators together are the hazard lights. Only recorded vehicles have the last. */
export const LIGHT = Object.freeze({ left: 1, right: 2, horn: 4, brake: 8, blue: 16 });

/** The buttons of an input message's `lights`, in its order. */
export const LIGHT_BUTTONS = [
  'left_indicator', 'right_indicator', 'hazard', 'horn',
] as const;

/** The lit lamps of a traffic light in each state. */
export const LIT: Record<string, readonly string[] | undefined> = {
  red: ['red'], redYellow: ['red', 'yellow'], yellow: ['yellow'], green: ['green'],
};

const BLINKS_PER_S = 1.5;
const FLASHES_PER_S = 2;

/**
 * Return the lights that are lit at a time: some blink in simulation time.
 * @param lights bits; undefined means none
 * @param t simulation time [s]
 */
export function shining(lights: number | undefined,
  t: number): { left: boolean; right: boolean; horn: boolean; brake: boolean; blue: boolean } {
  const bits = Number.isFinite(lights) ? Number(lights) : 0;
  const lit = (t * BLINKS_PER_S) % 1 < 0.5;
  return {
    left: lit && (bits & LIGHT.left) > 0, right: lit && (bits & LIGHT.right) > 0,
    horn: (bits & LIGHT.horn) > 0, brake: (bits & LIGHT.brake) > 0,
    blue: (bits & LIGHT.blue) > 0 && (t * FLASHES_PER_S) % 1 < 0.5,
  };
}
