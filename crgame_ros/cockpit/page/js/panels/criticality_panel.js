// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The panel of criticality: measures now, at worst, and over time with their thresholds. */

import { limitsOf } from '../criticality.js';
import { element, setAttribute, setText } from '../dom.js';
import { clockTime, fixed, NONE } from './format.js';
import { HistoryPanel } from './history.js';

/** @import { Limits, MeasureName, Worst } from '../criticality.js' */
/** @import { Criticality } from '../messages.js' */
/** @import { Store } from '../store.js' */
/** @import { Quantity } from './quantities.js' */

const PERIOD_MS = 200;

/** @type {Quantity[]} */
const QUANTITIES = [
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
];

/** @type {[MeasureName, string, string, string][]} name, title, unit, explanation */
const ROWS = [
  ['gap', 'Gap', 'm', 'bumper to bumper to the leader, along the own path'],
  ['time_gap', 'Time gap', 's', 'gap divided by the own speed'],
  ['ttc', 'TTC', 's', 'gap divided by the closing speed'],
  ['ttc_a', 'TTC, accelerating', 's', 'with both accelerations held until either stands'],
  ['ttc_2d', 'TTC, any direction', 's', 'until footprints touch at constant velocity and heading'],
  ['drac', 'DRAC', 'm/s²', 'deceleration to avoid a crash'],
  ['a_req', 'Required', 'm/s²', 'constant acceleration that just avoids contact'],
  ['min_distance', 'Distance', 'm', 'of the footprints'],
  ['pet', 'PET', 's', 'from one leaving the crossing area to the other entering it'],
];

/**
 * Make the panel.
 *
 * @param {HTMLElement} root #panel-criticality
 * @param {Store} store
 * @returns {HistoryPanel} its plots
 */
export function createCriticality(root, store) {
  const tables = element('div', {});
  const plots = element('div', { class: 'history' });
  const hint = element('p', { class: 'hint', text: 'No other is near.' });
  root.append(plots, hint, tables);
  const panel = new HistoryPanel(plots, store, QUANTITIES);
  /** @type {Map<string, VehicleTable>} */
  const shown = new Map();
  const update = () => {
    if (root.hidden || store.scene === null) {
      return;
    }
    store.criticality.want();
    const ids = panel.selected.map(({ id }) => id);
    if (ids.join() !== [...shown.keys()].join()) {
      shown.clear();
      ids.forEach((id) => shown.set(id, new VehicleTable(id)));
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
  /** @type {Map<MeasureName, HTMLElement[]>} */
  #cells = new Map();
  #sum = element('p', { class: 'hint' });

  /** @param {string} id of the vehicle */
  constructor(id) {
    this.#id = id;
    const rows = ROWS.map(([name, title, unit, explanation]) => {
      const cells = [element('td', {}), element('td', {}), element('td', {})];
      this.#cells.set(name, cells);
      return element('tr', { 'data-key': name, title: explanation },
        element('th', { scope: 'row', text: `${title} [${unit}]` }), ...cells);
    });
    this.root = element('section', { 'data-id': id }, element('h3', { text: id }),
      element('table', { class: 'figures criticality' },
        element('caption', { class: 'unseen', text: `Criticality of ${id}` }),
        element('thead', {}, element('tr', {}, element('th', {}),
          ...['now', 'to', 'worst'].map((text) => element('th', { scope: 'col', text })))),
        element('tbody', {}, ...rows)), this.#sum);
  }

  /**
   * @param {Store} store
   * @param {number} t [s]
   */
  update(store, t) {
    const index = store.vehicleIndex(this.#id);
    const told = store.status?.criticality?.[this.#id];
    const limits = limitsOf(store.status);
    for (const [name, [now, to, worst]] of this.#cells) {
      const found = store.criticality.at(t, index, name);
      setText(now, fixed(found?.value, 2));
      setText(to, found === null ? NONE : nameOf(store, found.of));
      setAttribute(now, 'data-late', isCritical(limits, name, found?.value));
      const past = worstOf(store, told, name, store.criticality.worst(t, index, name));
      setText(worst, past === null ? NONE
        : `${fixed(past.value, 2)} (${past.of}, ${clockTime(past.t)})`);
      setAttribute(worst, 'data-late', isCritical(limits, name, past?.value));
    }
    setText(this.#sum, told && told.tet_s !== null
      ? `Below a TTC of ${fixed(limits.ttc, 1)} s for ${fixed(told.tet_s, 1)} s (TET)` : '');
  }
}

/**
 * Return the worst value; of a live run as the node reports it, from its start on.
 *
 * @param {Store} store
 * @param {Criticality|undefined} told
 * @param {MeasureName} name
 * @param {Worst|null} seen
 * @returns {{value: number, of: string, t: number}|null}
 */
function worstOf(store, told, name, seen) {
  const known = told?.worst[name];
  const own = seen === null ? null : { ...seen, of: nameOf(store, seen.of) };
  if (!known || known.value === null || known.t === null) {
    return own;
  }
  const greater = name === 'drac';
  return own !== null && (greater ? own.value > known.value : own.value < known.value)
    ? own : { value: known.value, of: known.of, t: known.t };
}

/**
 * @param {Store} store
 * @param {number} column of vehicles, then objects
 */
function nameOf(store, column) {
  const { vehicles = [], objects = [] } = store.scene ?? {};
  return (vehicles[column] ?? objects[column - vehicles.length])?.id ?? NONE;
}

/**
 * @param {Limits} limits
 * @param {MeasureName} name
 * @param {number|undefined} value
 */
function isCritical(limits, name, value) {
  if (value === undefined) {
    return false;
  }
  switch (name) {
    case 'ttc': case 'pet': return value < limits[name];
    case 'drac': return value > limits.drac;
    case 'gap': case 'min_distance': return value <= 0;
    default: return false;
  }
}
