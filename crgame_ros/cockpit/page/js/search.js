// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Searching what is in the order of its time. */

/**
 * Count those at the beginning of an ordered list for which something holds.
 *
 * @param {number} length of the list
 * @param {(index: number) => boolean} holds true up to some place and false from there on
 * @returns {number} that place: the index of the first for which it does not hold
 */
export function countWhile(length, holds) {
  let low = 0;
  let high = length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (holds(middle)) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  return low;
}
