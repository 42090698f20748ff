// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The page's own words in the participant's language. */

import type { WordTable } from './desk_messages.js';

/** Words by their key; the server sends them before anything is shown. */
export class Words {
  #table: WordTable = {};

  load(table: WordTable) {
    this.#table = table;
  }

  /**
   * Return a text.
   *
   * @param values for the placeholders in braces
   */
  of(key: string, values: Record<string, string | number> = {}): string {
    return (this.#table[key] ?? key).replaceAll(
      /\{(\w+)\}/g, (whole, name) => (Object.hasOwn(values, name) ? `${values[name]}` : whole));
  }
}
