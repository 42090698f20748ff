// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The page's own words in the participant's language. */

/** @import { WordTable } from './desk_messages.js' */

/** Words by their key; the server sends them before anything is shown. */
export class Words {
  /** @type {WordTable} */
  #table = {};

  /** @param {WordTable} table */
  load(table) {
    this.#table = table;
  }

  /**
   * Return a text.
   *
   * @param {string} key
   * @param {Record<string, string|number>} [values] for the placeholders in braces
   * @returns {string}
   */
  of(key, values = {}) {
    return (this.#table[key] ?? key).replaceAll(
      /\{(\w+)\}/g, (whole, name) => (Object.hasOwn(values, name) ? `${values[name]}` : whole));
  }
}
