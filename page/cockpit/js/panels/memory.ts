// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Preferences that the page keeps on this machine between visits; nothing about a run. */

const PREFIX = 'crgame.';

/**
 * @param name of a preference
 * @returns its value; empty if none was kept or the browser keeps nothing
 */
export function recall(name: string): string {
  try {
    return window.localStorage.getItem(PREFIX + name) ?? '';
  } catch {
    // Storage may be forbidden in the browser: each visit then begins with the defaults.
    return '';
  }
}

/**
 * @param name of a preference
 * @param value to keep; an empty one forgets it
 */
export function remember(name: string, value: string) {
  try {
    if (value === '') {
      window.localStorage.removeItem(PREFIX + name);
    } else {
      window.localStorage.setItem(PREFIX + name, value);
    }
  } catch {
    // As above: a preference that cannot be kept lasts until the page is closed.
  }
}
