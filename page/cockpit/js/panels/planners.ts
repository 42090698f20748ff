// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The status of each AV's planner, and the switch that stops and restarts it. */

import { element, setAttribute, setText } from '../dom.js';
import { countText } from '../perception/unseen.js';
import { reasonAgainst } from '../rights.js';
import { DEGREES } from '../units.js';
import { baseName } from './event_words.js';
import { count, fixed, oneLine } from './format.js';
import { icon } from './icons.js';

import type { Connection } from '../connection.js';
import type { PlannerStatus } from '../messages.js';
import type { Store } from '../store.js';

export type Planner = Partial<PlannerStatus>; // the known part of it

const COLUMNS: [name: string, explanation: string, text: (planner: Planner) => string,
  unit: string][] = [
  ['Latency', 'from the request to the plan', (p) => fixed(p.latency_ms, 0), 'ms'],
  ['Age', 'of the plan that is being followed', (p) => fixed(p.age_ms, 0), 'ms'],
  ['Accepted', 'plans taken', (p) => count(p.accepted), ''],
  ['Refused', 'plans that broke a rule', (p) => count(p.refused), ''],
  ['Fallbacks', 'brakings where the planner found no plan', (p) => count(p.fallbacks), ''],
];

const TRACKING_TITLE = "Deviation from the middle of its route's lane, and from the position that "
  + 'its plan of a second ago gave for now; in parentheses the worst of the run';
// Of a tracked AV: name of the error, factor to the unit, unit, digits.
const ERRORS: [name: string, factor: number, unit: string, digits: number][] = [
  ['lane', 1, 'm', 2], ['lateral', 1, 'm', 2], ['along', 1, 'm', 2],
  ['heading', DEGREES, '°', 1], ['speed', 1, 'm/s', 2],
];

export function createPlanners(root: HTMLElement, store: Store, connection: Connection) {
  const empty = element('p', { class: 'hint', text: 'No autonomous vehicle takes part.' });
  const table = element('table', { class: 'planners' },
    element('caption', { class: 'unseen', text: 'Planners' }),
    element('thead', {}, element('tr', {}, element('th', { scope: 'col', text: 'AV' }),
      ...COLUMNS.map(([name, explanation, , unit]) => element('th', {
        scope: 'col', title: explanation, text: name,
      }, unit ? element('span', { class: 'unit', text: unit }) : null)))));
  root.append(element('h2', { text: 'Planners' }), empty, table);
  const rows = new Map<string, ReturnType<typeof makeRow>>();

  const update = () => {
    if (root.closest('[hidden]')) {
      return;
    }
    for (const [av, row] of rows) {
      row.update(store.status?.planners?.[av] ?? {}, store);
    }
  };
  const rebuild = () => {
    for (const row of rows.values()) {
      row.root.remove();
    }
    rows.clear();
    for (const vehicle of store.scene?.vehicles ?? []) {
      if (vehicle.role === 'autonomous') {
        rows.set(vehicle.id, makeRow(vehicle.id, connection));
      }
    }
    table.append(...[...rows.values()].map((row) => row.root));
    table.hidden = rows.size === 0;
    empty.hidden = rows.size > 0;
    update();
  };
  store.on('scene', rebuild);
  store.on(['status', 'connection'], update);
  new MutationObserver(update).observe(root, { attributeFilter: ['hidden'] });
  rebuild();
}

function makeRow(av: string, connection: Connection) {
  const name = element('span', { class: 'dim planner-name' });
  const state = element('span', { class: 'tag' });
  const error = element('p', { class: 'field-error', role: 'alert' });
  const refusal = element('p', { class: 'dim refusal' });
  const tracking = element('p', { class: 'dim tracking', title: TRACKING_TITLE });
  const seen = element('p', { class: 'dim seen' });
  const cells = COLUMNS.map(() => element('td', {}));
  const wanted = { run: true, waits: false };
  const button = element('button', {
    type: 'button', class: 'planner-switch',
    on: {
      click: async () => {
        wanted.waits = true;
        button.disabled = true;
        const reply = await connection.request({ type: 'planner', av, run: wanted.run });
        setText(error, reply.ok ? '' : oneLine(reply.text));
        wanted.waits = false;
        button.disabled = false;
      },
    },
  });
  return {
    root: element('tbody', { 'data-av': av },
      element('tr', { class: 'planner-head' }, element('td', { colspan: COLUMNS.length + 1 },
        element('div', {}, element('strong', { class: 'av', text: av }), name, state, button),
        refusal, seen, tracking, error)),
      element('tr', {}, element('td', {}), ...cells)),
    update(planner: Planner, store: Store) {
      const stopped = planner.running === false;
      wanted.run = stopped;
      setText(name, baseName(planner.planner || store.scene?.planners?.[av]));
      // A stopped planner's plan gets old because no new one is requested.
      const word = stopped ? 'stopped' : planner.stale ? 'stale' : 'running';
      setText(state, word);
      setAttribute(state, 'data-state', word);
      const label = `${stopped ? 'Let the planner of' : 'Stop the planner of'} ${av}`
        + `${stopped ? ' go on' : ''}`;
      if (button.getAttribute('aria-label') !== label) {
        button.replaceChildren(icon(stopped ? 'go' : 'stop'), stopped ? 'Go' : 'Stop');
        button.setAttribute('aria-label', label);
      }
      setAttribute(button, 'hidden', store.mode === 'replay');
      setAttribute(button, 'disabled', wanted.waits || !store.rights.directs);
      button.title = reasonAgainst(store, 'direct', 'stop planners') || label;
      cells.forEach((cell, at) => setText(cell, COLUMNS[at][2](planner)));
      setAttribute(cells[1], 'data-late', Boolean(planner.stale) && !stopped);
      const why = oneLine(planner.last_refusal);
      setText(refusal, [
        (planner.plan_time_ms ?? 0) > 0 ? `plans in ${fixed(planner.plan_time_ms, 1)} ms` : '',
        why ? `last refused: ${why}` : '',
        planner.failure ? `last braked: ${oneLine(planner.failure)}` : '',
        planner.of_others ? `another program answers as well (${planner.of_others} plans)` : '',
      ].filter(Boolean).join(', '));
      setText(tracking, trackingText(planner.tracking));
      const { perception, world } = window.crgame;
      const counted = world.followed === av ? perception?.count ?? null : null;
      setText(seen, counted === null ? '' : countText(counted));
    },
  };
}

/** Return how far a tracked AV is from its lane and its plan: now, and at worst so far. */
function trackingText(tracking: PlannerStatus['tracking'] | undefined) {
  if (!tracking) {
    return '';
  }
  const parts = ERRORS.map(([name, factor, unit, digits]) => {
    const [now, worst] = ['', 'worst_'].map((when) => fixed(
      factor * (tracking[`${when}${name}_error`] ?? NaN), digits));
    return `${name} ${now} ${unit} (${worst})`;
  });
  return `off its lane and plan: ${parts.join(', ')}`;
}
