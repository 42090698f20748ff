// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A page's own words in the language of its reader. */

import type { WordTable } from './desk_messages.js';

/** Words by their key; the server sends them before anything is shown. */
export class Words {
  #table: WordTable = {};
  #language = 'en';

  /** @param language of the words, which numbers are written in too. */
  load(table: WordTable, language: string) {
    this.#table = table;
    this.#language = language;
  }

  /**
   * Return a number as text.
   * @param digits behind its decimal mark; without, as many of six digits as it needs.
   */
  number(value: number, digits?: number): string {
    return value.toLocaleString(this.#language, { useGrouping: false, ...digits === undefined
      ? { maximumSignificantDigits: 6 }
      : { minimumFractionDigits: digits, maximumFractionDigits: digits } });
  }

  /** Return a text; `values` for the placeholders in braces. */
  of(key: string, values: Record<string, string | number> = {}): string {
    return (this.#table[key] ?? key).replaceAll(
      /\{(\w+)\}/g, (whole, name) => (Object.hasOwn(values, name) ? `${values[name]}` : whole));
  }
}
