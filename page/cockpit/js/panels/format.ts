// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Readable formats of numbers, times and lists. */

/** Placeholder for a missing value. */
export const NONE = '–';

/**
 * @param {number|null|undefined} value
 * @param {number} digits after the point
 * @returns {string} with a true minus sign; NONE if it is not a number
 */
export function fixed(value, digits) {
  if (value === null || value === undefined || !Number.isFinite(Number(value))) {
    return NONE;
  }
  const text = Number(value).toFixed(digits);
  const rounded = Number(text) === 0 ? (0).toFixed(digits) : text;
  return rounded.replace('-', '−');
}

/**
 * @param {number|null|undefined} seconds simulation time [s]
 * @returns {string} as the clock in the header shows it: 65.2 s
 */
export function clockTime(seconds) {
  return Number.isFinite(seconds) ? `${fixed(seconds, 1)} s` : NONE;
}

/**
 * @param {number|null|undefined} value a whole number
 * @returns {string} with thin spaces between thousands
 */
export function count(value) {
  return fixed(value, 0).replace(/\B(?=(\d{3})+(?!\d))/g, '\u202f');
}

/**
 * @param {number} number how many
 * @param {string} one the noun in the singular
 * @param {string} [many] the plural; by default with an s
 * @returns {string} "1 vehicle", "3 vehicles"
 */
export function plural(number, one, many = `${one}s`) {
  return `${number} ${number === 1 ? one : many}`;
}

/**
 * @param {unknown} error what was thrown
 * @returns {string} its message
 */
export function errorText(error) {
  return error instanceof Error ? error.message : String(error);
}

// Characters written from right to left, or that change the direction of their neighbours.
const TURNING = /[\u0590-\u08ff\u200e\u200f\u202a-\u202e\u2066-\u2069]/;

/**
 * Isolate a foreign text, so that its direction does not affect its neighbours.
 *
 * @param {string} text
 * @returns {string} the same, or between the signs that isolate it (Unicode's FSI and PDI)
 */
export function isolated(text) {
  return TURNING.test(text) ? `\u2068${text}\u2069` : text;
}

/**
 * Convert the text of a server or an exception to one readable line.
 *
 * @param {unknown} text
 * @returns {string}
 */
export function oneLine(text) {
  return isolated(String(text ?? '').replace(/\s+/g, ' ').trim());
}
