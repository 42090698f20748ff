// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Files that the page creates for saving: tables as CSV, pictures. */

import { element } from '../dom.js';

// Text that a spreadsheet would read as a formula.
const FORMULA = /^[=+\-@\t]/;
const NUMBER = /^[+-]?[\d.]+(e[+-]?\d+)?$/i;

/**
 * Write a table as CSV (RFC 4180).
 *
 * @param {(string|number)[][]} rows
 * @returns {string}
 */
export function csvOf(rows) {
  return rows.map((row) => row.map(cell).join(',')).join('\r\n') + '\r\n';
}

/** @param {string|number} value */
function cell(value) {
  const text = String(value).replaceAll('−', '-').replaceAll('\u202f', '');
  const safe = FORMULA.test(text) && !NUMBER.test(text) ? `'${text}` : text;
  return /[",\r\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
}

/**
 * Read the rows of a table on the page.
 *
 * @param {HTMLElement} table or a list of terms
 * @returns {string[][]}
 */
export function rowsOf(table) {
  return [...table.querySelectorAll('tr')].map((row) => (
    [...row.querySelectorAll('th, td')].map((node) => (node.textContent ?? '').trim())));
}

/**
 * Save a file through the browser.
 *
 * @param {string} name
 * @param {Blob} content
 */
export function save(name, content) {
  const href = URL.createObjectURL(content);
  const link = element('a', { href, download: name });
  link.click();
  // Only after the browser has begun to read it.
  setTimeout(() => URL.revokeObjectURL(href), 10000);
}

/**
 * Return a file name from the run and the time.
 *
 * @param {string} what
 * @param {string} ending
 */
export function fileName(what, ending) {
  const { scene, status } = window.crgame.store;
  const run = (scene?.benchmark_id ?? 'crgame').replace(/[^\w-]+/g, '_');
  return `${run}_${what}_${(status?.t ?? 0).toFixed(1)}s.${ending}`;
}
