// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Readable formats of numbers, times and lists. */

/** Placeholder for a missing value. */
export const NONE = '–';

/** Return a number with a true minus sign; NONE if it is none; `digits` after the point. */
export function fixed(value: number | null | undefined, digits: number): string {
  if (value === null || value === undefined || !Number.isFinite(Number(value))) {
    return NONE;
  }
  const text = Number(value).toFixed(digits);
  const rounded = Number(text) === 0 ? (0).toFixed(digits) : text;
  return rounded.replace('-', '−');
}

/** Return a simulation time as the clock in the header shows it: 65.2 s. */
export function clockTime(seconds: number | null | undefined): string {
  return Number.isFinite(seconds) ? `${fixed(seconds, 1)} s` : NONE;
}

/** Return a whole number with thin spaces between thousands. */
export function count(value: number | null | undefined): string {
  return fixed(value, 0).replace(/\B(?=(\d{3})+(?!\d))/g, '\u202f');
}

/**
 * @param number how many
 * @param one the noun in the singular
 * @param many the plural; by default with an s
 * @returns "1 vehicle", "3 vehicles"
 */
export function plural(number: number, one: string, many = `${one}s`): string {
  return `${number} ${number === 1 ? one : many}`;
}

/** Return the message of what was thrown. */
export function errorText(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}

// Characters written from right to left, or that change the direction of their neighbours.
const TURNING = /[\u0590-\u08ff\u200e\u200f\u202a-\u202e\u2066-\u2069]/;

/**
 * Isolate a foreign text, so that its direction does not affect its neighbours.
 * @returns the same, or between the signs that isolate it (Unicode's FSI and PDI)
 */
export function isolated(text: string): string {
  return TURNING.test(text) ? `\u2068${text}\u2069` : text;
}

/** Convert the text of a server or an exception to one readable line. */
export function oneLine(text: unknown): string {
  return isolated(String(text ?? '').replace(/\s+/g, ' ').trim());
}
