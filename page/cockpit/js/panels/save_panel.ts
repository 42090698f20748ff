// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Buttons that save what the page shows, and their files: plots, map or 3D view, tables. */

import { element, part } from '../dom.js';
import { PANELS } from '../parts.js';
import { themeColor } from '../world/palette.js';
import { toolButton } from '../world/toolbar.js';
import { errorText } from './format.js';
import { loadPlotly } from './plotly.js';

import type { Store } from '../store.js';
import type { Chart } from './chart.js';
import type { HistoryPanel } from './history.js';

const DOWN = 'M12 4v11M7 10l5 5 5-5M4 17v3h16v-3';

/** Put the buttons into the panels and on the map. */
export function createSaving(root: HTMLElement,
  store: Store): { savePlots: (panel: string, format: string) => Promise<void> } {
  const savePlots = async (name: string, format: string) => {
    const panel = window.crgame[name] as HistoryPanel | undefined;
    if (panel === undefined) {
      return;
    }
    try {
      save(fileName(name, format), await plots(panel, format));
    } catch (error) {
      store.receive({ type: 'notice', level: 'error',
        text: `The plots cannot be saved: ${errorText(error)}` });
    }
  };
  for (const name of panelsThatSave('plots')) {
    const choice = element('select', { 'aria-label': 'Save the plots', title: 'Save the plots',
      on: { change: () => {
        const format = choice.value;
        choice.value = '';
        savePlots(name, format);
      } } }, ...[['', 'Save …'], ['png', 'PNG'], ['svg', 'SVG'], ['csv', 'CSV']].map(
      ([value, text]) => element('option', { value, text })));
    part(root, `panel-${name}`).querySelector('.history-bar')?.append(choice);
  }
  for (const name of panelsThatSave('tables')) {
    const panel = part(root, `panel-${name}`);
    panel.append(element('button', { type: 'button', 'data-action': 'save-tables',
      text: 'Save the tables as CSV', on: { click: () => saveTables(panel, name) } }));
  }
  addViewButton(store);
  return { savePlots };
}

/** @returns their names */
function panelsThatSave(what: 'plots' | 'tables'): string[] {
  return PANELS.filter(({ saves }) => saves?.includes(what)).map(({ name }) => name);
}

async function plots(panel: HistoryPanel, format: string) {
  if (format === 'csv') {
    return new Blob([csvOf([['quantity', 'unit', 'line', 'time_s', 'value'], ...panel.rows])],
      { type: 'text/csv' });
  }
  const svg = await picturesOf(panel.charts);
  return format === 'svg' ? new Blob([svg.text], { type: 'image/svg+xml' }) : rasterised(svg);
}

function saveTables(panel: HTMLElement, name: string) {
  const rows = [...panel.querySelectorAll('table')].flatMap((table, i) => [
    ...(i > 0 ? [['']] : []),
    [table.closest('section')?.querySelector('h3')?.textContent
      ?? table.previousElementSibling?.textContent ?? name],
    ...rowsOf(table)]);
  save(fileName(name, 'csv'), new Blob([csvOf(rows)], { type: 'text/csv' }));
}

/** In its own group, because other groups are hidden if they do not apply. */
function addViewButton(store: Store) {
  const group = element('div', { class: 'world-group view-save' });
  document.querySelector('.world-toolbar')?.append(group);
  toolButton(group, DOWN, 'Save the map or the 3D view as PNG', async () => {
    const is3d = window.crgame.view3d?.on === true;
    const picture = await (is3d ? window.crgame.view3d?.snapshot() : pictureOfMap());
    if (picture) {
      save(fileName(is3d ? '3d' : 'map', 'png'), picture);
    } else {
      store.receive({ type: 'notice', level: 'error', text: 'There is no picture to be saved.' });
    }
  }).dataset.action = 'save-view';
}

function pictureOfMap(): Promise<Blob | null> {
  return new Promise((resolve) => {
    (document.querySelector('#world') as HTMLCanvasElement | null)?.toBlob(resolve);
  });
}

const HEAD_PX = 26;
const WIDTH_PX = 720;
const HEIGHT_PX = 190;
const PIXELS = 2;

interface Picture { text: string; width: number; height: number } // SVG and its size [px]

/** Draw plots below each other. */
async function picturesOf(charts: Chart[]): Promise<Picture> {
  const library = await loadPlotly();
  const row_px = HEAD_PX + HEIGHT_PX;
  const height = row_px * charts.length;
  const rows = [];
  for (const [i, chart] of charts.entries()) {
    const { title, unit } = chart.quantity;
    const address = await library.toImage(chart.plot, {
      format: 'svg', width: WIDTH_PX, height: HEIGHT_PX });
    // Joined as text: parsed in this page, its inline styles would be refused.
    const drawn = decodeURIComponent(address.slice(address.indexOf(',') + 1));
    rows.push(`<text x="8" y="${i * row_px + 18}" fill="${themeColor('text')}" font-size="14" `
      + `font-family="sans-serif">${escaped(unit ? `${title} [${unit}]` : title)}</text>`,
    drawn.replace(/^[^]*?<svg /, `<svg y="${i * row_px + HEAD_PX}" `));
  }
  const text = `<svg xmlns="http://www.w3.org/2000/svg" width="${WIDTH_PX}" height="${height}" `
    + `viewBox="0 0 ${WIDTH_PX} ${height}"><rect width="${WIDTH_PX}" height="${height}" `
    + `fill="${themeColor('surface')}"/>${rows.join('')}</svg>`;
  return { text, width: WIDTH_PX, height };
}

function escaped(text: string) {
  return text.replaceAll('&', '&amp;').replaceAll('<', '&lt;').replaceAll('>', '&gt;');
}

/** Convert a picture to pixels; return PNG. */
async function rasterised({ text, width, height }: Picture): Promise<Blob> {
  const address = URL.createObjectURL(new Blob([text], { type: 'image/svg+xml' }));
  try {
    const image = new Image();
    image.src = address;
    await image.decode();
    const canvas = document.createElement('canvas');
    canvas.width = PIXELS * width;
    canvas.height = PIXELS * height;
    canvas.getContext('2d')?.drawImage(image, 0, 0, canvas.width, canvas.height);
    return await new Promise((resolve, reject) => {
      canvas.toBlob((blob) => (blob === null ? reject(new Error('no picture')) : resolve(blob)));
    });
  } finally {
    URL.revokeObjectURL(address);
  }
}

// Text that a spreadsheet would read as a formula.
const FORMULA = /^[=+\-@\t]/;
const NUMBER = /^[+-]?[\d.]+(e[+-]?\d+)?$/i;

/** Write a table as CSV (RFC 4180). */
function csvOf(rows: (string | number)[][]): string {
  return rows.map((row) => row.map(cell).join(',')).join('\r\n') + '\r\n';
}

function cell(value: string | number) {
  const text = String(value).replaceAll('−', '-').replaceAll('\u202f', '');
  const safe = FORMULA.test(text) && !NUMBER.test(text) ? `'${text}` : text;
  return /[",\r\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
}

/** Read the rows of a table, or of a list of terms, on the page. */
function rowsOf(table: HTMLElement): string[][] {
  return [...table.querySelectorAll('tr')].map((row) => (
    [...row.querySelectorAll('th, td')].map((node) => (node.textContent ?? '').trim())));
}

/** Save a file through the browser. */
function save(name: string, content: Blob) {
  const href = URL.createObjectURL(content);
  const link = element('a', { href, download: name });
  link.click();
  // Only after the browser has begun to read it.
  setTimeout(() => URL.revokeObjectURL(href), 10000);
}

/** Return a file name from the run and the time. */
function fileName(what: string, ending: string) {
  const { scene, status } = window.crgame.store;
  const run = (scene?.benchmark_id ?? 'crgame').replace(/[^\w-]+/g, '_');
  return `${run}_${what}_${(status?.t ?? 0).toFixed(1)}s.${ending}`;
}
