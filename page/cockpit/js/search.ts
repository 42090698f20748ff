// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Binary search in ordered lists. */

/**
 * Count the items at the beginning of an ordered list that satisfy a condition.
 * @param length of the list
 * @param holds true up to some place and false from there on
 * @returns index of the first item for which it is false
 */
export function countWhile(length: number, holds: (index: number) => boolean): number {
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
