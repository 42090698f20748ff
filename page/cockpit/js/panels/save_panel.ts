// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Buttons that save what the page shows: the plots, the map or the 3D view, and the tables. */

import { element, part } from '../dom.js';
import { PANELS } from '../parts.js';
import { toolButton } from '../world/toolbar.js';
import { picturesOf, rasterised } from './chart_picture.js';
import { errorText } from './format.js';
import { csvOf, fileName, rowsOf, save } from './saved_file.js';

import type { HistoryPanel } from './history.js';
import type { Store } from '../store.js';

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
