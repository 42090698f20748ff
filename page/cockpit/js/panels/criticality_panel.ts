// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The panel of criticality: measures now, at worst, and over time with their thresholds. */

import { isCritical, limitsOf } from '../criticality.js';
import { element, setAttribute, setText } from '../dom.js';
import { clockTime, fixed, NONE } from './format.js';
import { HistoryPanel } from './history.js';

import type { Worst } from '../criticality.js';
import type { Criticality, Exposure, Measure } from '../messages.js';
import type { Store } from '../store.js';
import type { Quantity } from './quantities.js';

const PERIOD_MS = 200;

const QUANTITIES: Quantity[] = [
  {
    key: 'ttc', title: 'TTC', unit: 's', digits: 1, range: [0, 10],
    lines: [{ critical: 'ttc' }, { critical: 'ttc_2d', name: 'any direction' },
      { limit: 'ttc', name: 'limit' }],
  },
  {
    key: 'time_gap', title: 'Time gap', unit: 's', digits: 1, range: [0, 6],
    lines: [{ critical: 'time_gap' }],
  },
  {
    key: 'drac', title: 'Braking needed', unit: 'm/s²', digits: 1,
    lines: [{ critical: 'drac' }, { limit: 'drac', name: 'limit' }],
  },
  {
    key: 'gap', title: 'Gap to the leader', unit: 'm', digits: 1, lines: [{ critical: 'gap' }],
  },
  {
    key: 'min_distance', title: 'Distance to the nearest', unit: 'm', digits: 1,
    lines: [{ critical: 'min_distance' }],
  },
  { key: 'exposure', title: 'Time exposed', unit: 's', digits: 1, lines: [{ exposures: 's' }] },
];

// Its value is that of the time gap.
const TWICE = 'thw';

/** Make the panel; return its plots. */
export function createCriticality(root: HTMLElement, store: Store): HistoryPanel {
  const tables = element('div', {});
  const plots = element('div', { class: 'history' });
  const hint = element('p', { class: 'hint', text: 'No other is near.' });
  root.append(plots, hint, tables);
  const panel = new HistoryPanel(plots, store, QUANTITIES);
  const shown = new Map<string, VehicleTable>();
  const update = () => {
    if (root.hidden || store.scene === null) {
      return;
    }
    store.criticality.want();
    const ids = panel.selected.map(({ id }) => id);
    if (ids.join() !== [...shown.keys()].join()) {
      shown.clear();
      ids.forEach((id) => shown.set(id, new VehicleTable(id, store.measures, store.exposures)));
      tables.replaceChildren(...[...shown.values()].map((table) => table.root));
    }
    const t = store.displayed(performance.now())?.t ?? 0;
    setAttribute(hint, 'hidden', store.criticality.length > 0);
    shown.forEach((table) => table.update(store, t));
  };
  setInterval(update, PERIOD_MS);
  return panel;
}

/** One vehicle's measures: now, and at worst. */
class VehicleTable {
  #id;
  #cells = new Map<Measure, HTMLElement[]>();
  #sums = new Map<string, HTMLElement>();
  root;

  /** @param id of the vehicle */
  constructor(id: string, measures: Measure[], exposures: Exposure[]) {
    this.#id = id;
    const rows = measures.filter(({ name }) => name !== TWICE).map((measure) => {
      const cells = [element('td', {}), element('td', {}), element('td', {})];
      this.#cells.set(measure, cells);
      return element('tr', { 'data-key': measure.name, title: measure.definition },
        element('th', { scope: 'row', text: `${measure.label} [${measure.unit}]` }), ...cells);
    });
    const sums = exposures.map(({ name, label, unit, definition }) => {
      const cell = element('td', {});
      this.#sums.set(name, cell);
      return element('tr', { 'data-key': name, title: definition },
        element('th', { scope: 'row', text: `${label} [${unit}]` }), cell);
    });
    this.root = element('section', { 'data-id': id }, element('h3', { text: id }),
      element('table', { class: 'figures criticality' },
        element('caption', { class: 'unseen', text: `Criticality of ${id}` }),
        element('thead', {}, element('tr', {}, element('th', {}),
          ...['now', 'to', 'worst'].map((text) => element('th', { scope: 'col', text })))),
        element('tbody', {}, ...rows)),
      element('table', { class: 'figures exposures' },
        element('caption', { class: 'unseen', text: `${id} over the whole run` }),
        element('tbody', {}, ...sums)));
  }

  /** @param t [s] */
  update(store: Store, t: number) {
    const index = store.vehicleIndex(this.#id);
    const told = store.status?.criticality?.[this.#id];
    const limits = limitsOf(store.measures, store.status);
    for (const [measure, [now, to, worst]] of this.#cells) {
      const { name } = measure;
      const found = store.criticality.at(t, index, name);
      setText(now, fixed(found?.value, 2));
      setText(to, found === null ? NONE : nameOf(store, found.of));
      setAttribute(now, 'data-late', isCritical(measure, limits, found?.value));
      const past = worstOf(store, told, measure, store.criticality.worst(t, index, name));
      setText(worst, past === null ? NONE
        : `${fixed(past.value, 2)} (${past.of}, ${clockTime(past.t)})`);
      setAttribute(worst, 'data-late', isCritical(measure, limits, past?.value));
    }
    for (const [name, cell] of this.#sums) {
      setText(cell, fixed(told?.exposures[name], 1));
    }
  }
}

/** Return the worst value; of a live run as the node reports it, from its start on. */
function worstOf(store: Store, told: Criticality | undefined, { name, worst }: Measure,
  seen: Worst | null): { value: number; of: string; t: number } | null {
  const known = told?.worst[name];
  const own = seen === null ? null : { ...seen, of: nameOf(store, seen.of) };
  if (!known || known.value === null || known.t === null) {
    return own;
  }
  return own !== null && worst * (own.value - known.value) > 0
    ? own : { value: known.value, of: known.of, t: known.t };
}

/** @param column of vehicles, then objects */
function nameOf(store: Store, column: number) {
  const { vehicles = [], objects = [] } = store.scene ?? {};
  return (vehicles[column] ?? objects[column - vehicles.length])?.id ?? NONE;
}
