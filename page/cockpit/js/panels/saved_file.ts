// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Files that the page creates for saving: tables as CSV, pictures. */

import { element } from '../dom.js';

// Text that a spreadsheet would read as a formula.
const FORMULA = /^[=+\-@\t]/;
const NUMBER = /^[+-]?[\d.]+(e[+-]?\d+)?$/i;

/** Write a table as CSV (RFC 4180). */
export function csvOf(rows: (string | number)[][]): string {
  return rows.map((row) => row.map(cell).join(',')).join('\r\n') + '\r\n';
}

function cell(value: string | number) {
  const text = String(value).replaceAll('−', '-').replaceAll('\u202f', '');
  const safe = FORMULA.test(text) && !NUMBER.test(text) ? `'${text}` : text;
  return /[",\r\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
}

/** Read the rows of a table, or of a list of terms, on the page. */
export function rowsOf(table: HTMLElement): string[][] {
  return [...table.querySelectorAll('tr')].map((row) => (
    [...row.querySelectorAll('th, td')].map((node) => (node.textContent ?? '').trim())));
}

/** Save a file through the browser. */
export function save(name: string, content: Blob) {
  const href = URL.createObjectURL(content);
  const link = element('a', { href, download: name });
  link.click();
  // Only after the browser has begun to read it.
  setTimeout(() => URL.revokeObjectURL(href), 10000);
}

/** Return a file name from the run and the time. */
export function fileName(what: string, ending: string) {
  const { scene, status } = window.crgame.store;
  const run = (scene?.benchmark_id ?? 'crgame').replace(/[^\w-]+/g, '_');
  return `${run}_${what}_${(status?.t ?? 0).toFixed(1)}s.${ending}`;
}
