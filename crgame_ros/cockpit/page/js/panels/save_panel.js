// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Buttons that save what the page shows: the plots, the map and the tables. */

import { element, part } from '../dom.js';
import { toolButton } from '../world/toolbar.js';
import { picturesOf, rasterised } from './chart_picture.js';
import { errorText } from './format.js';
import { csvOf, fileName, rowsOf, save } from './saved_file.js';

/** @import { HistoryPanel } from './history.js' */
/** @import { Store } from '../store.js' */

const TABLES = ['timing', 'criticality'];
const PLOTS = ['history', 'criticality'];
const DOWN = 'M12 4v11M7 10l5 5 5-5M4 17v3h16v-3';

/**
 * Put the buttons into the panels and beside the map.
 *
 * @param {HTMLElement} root #panels
 * @param {Store} store
 * @returns {{savePlots: (panel: string, format: string) => Promise<void>}}
 */
export function createSaving(root, store) {
  /**
   * @param {string} name
   * @param {string} format
   */
  const savePlots = async (name, format) => {
    const panel = /** @type {HistoryPanel|undefined} */ (window.crgame[name]);
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
  for (const name of PLOTS) {
    const choice = element('select', { 'aria-label': 'Save the plots', title: 'Save the plots',
      on: { change: () => {
        const format = choice.value;
        choice.value = '';
        savePlots(name, format);
      } } }, ...[['', 'Save …'], ['png', 'PNG'], ['svg', 'SVG'], ['csv', 'CSV']].map(
      ([value, text]) => element('option', { value, text })));
    part(root, `panel-${name}`).querySelector('.history-bar')?.append(choice);
  }
  for (const name of TABLES) {
    const panel = part(root, `panel-${name}`);
    panel.append(element('button', { type: 'button', 'data-action': 'save-tables',
      text: 'Save the tables as CSV', on: { click: () => saveTables(panel, name) } }));
  }
  addViewButton();
  return { savePlots };
}

/**
 * @param {HistoryPanel} panel
 * @param {string} format
 */
async function plots(panel, format) {
  if (format === 'csv') {
    return new Blob([csvOf([['quantity', 'unit', 'line', 'time_s', 'value'], ...panel.rows])],
      { type: 'text/csv' });
  }
  const svg = await picturesOf(panel.charts);
  return format === 'svg' ? new Blob([svg.text], { type: 'image/svg+xml' }) : rasterised(svg);
}

/**
 * @param {HTMLElement} panel
 * @param {string} name
 */
function saveTables(panel, name) {
  const rows = [...panel.querySelectorAll('table')].flatMap((table, i) => [
    ...(i > 0 ? [['']] : []),
    [table.closest('section')?.querySelector('h3')?.textContent
      ?? table.previousElementSibling?.textContent ?? name],
    ...rowsOf(table)]);
  save(fileName(name, 'csv'), new Blob([csvOf(rows)], { type: 'text/csv' }));
}

function addViewButton() {
  /** @type {HTMLElement|null} */
  const group = document.querySelector('.world-group:last-child');
  /** @type {HTMLCanvasElement|null} */
  const canvas = document.querySelector('#world');
  if (group !== null && canvas !== null) {
    toolButton(group, DOWN, 'Save the map as PNG', () => canvas.toBlob((blob) => {
      if (blob !== null) {
        save(fileName('map', 'png'), blob);
      }
    })).dataset.action = 'save-map';
  }
}
