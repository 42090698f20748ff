// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Alarms: a frame around the world and a sign over it, an icon and a word in the header. */

import { element, part, setText } from '../dom.js';
import { clockTime, oneLine } from './format.js';
import { icon } from './icons.js';

import type { Alarm } from '../messages.js';
import type { Store } from '../store.js';

// kind: [word for the header, urgent]. Urgent ones frame the whole world, others mark its top.
const KINDS = new Map<string, [word: string, urgent: boolean]>([
  ['collision', ['Collision', true]],
  ['off_road', ['Off road', true]],
  ['lost_device', ['Input lost', true]],
  ['connection', ['No connection', true]],
  ['stale_plan', ['Plan stale', false]],
  ['recording', ['Recording failed', false]],
  ['late', ['Running late', false]],
  ['late_traffic', ['Traffic late', false]],
]);
// In a pause, nothing is late.
const WHILE_RUNNING = ['late', 'late_traffic'];
// How long an alarm stays visible after it has ended [ms].
const LINGERS_MS = 4000;
const CONNECTS_WITHIN_MS = 3000;

/** And its two texts. */
export interface Chip { chip: HTMLElement; says: HTMLElement; whom: HTMLElement }

export interface Shown extends Alarm, Chip {
  timer: number;
  urgent: boolean;
  ended: boolean;
  known: boolean;
  mine: boolean;
}

/** Show the alarms; return the `kinds` on the page now; `root`: #alarms in the header. */
export function createAlarms(root: HTMLElement, store: Store): { kinds: () => string[] } {
  const frame = part(document.body, 'alarm-frame');
  const signs = part(document.body, 'alarm-signs');
  const alarms = new Map<string, Shown>();
  const remove = (id: string) => {
    alarms.get(id)?.chip.remove();
    alarms.delete(id);
    paint(frame, signs, alarms);
    fitWords(root);
  };
  let wasConnected = false;
  const update = () => {
    wasConnected ||= store.connected;
    const runs = store.status === null || store.status.run === 'running'
      || store.mode === 'replay';
    const own = store.alarms.filter(({ kind }) => runs || !WHILE_RUNNING.includes(kind));
    const active = [...own, ...(wasConnected ? ownAlarms(store) : [])];
    for (const alarm of active) {
      const entry = alarms.get(alarm.id)
        ?? { ...alarm, ...makeChip(alarm), timer: 0, urgent: false, ended: false, known: false,
          mine: true };
      if (!alarms.has(alarm.id)) {
        alarms.set(alarm.id, entry);
        root.append(entry.chip);
        entry.chip.addEventListener('click', () => {
          entry.known = true;
          update();
        });
      }
      clearTimeout(entry.timer);
      Object.assign(entry, alarm, { known: entry.known && !entry.ended, ended: false,
        mine: concerns(alarm, store) });
      describe(entry, store);
    }
    const ids = new Set(active.map((alarm) => alarm.id));
    for (const [id, entry] of alarms) {
      if (!ids.has(id) && !entry.ended) {
        entry.ended = true;
        entry.timer = setTimeout(() => remove(id), LINGERS_MS);
        describe(entry, store);
      }
    }
    paint(frame, signs, alarms);
    fitWords(root);
  };
  store.on(['alarms', 'seats', 'run', 'connection'], update);
  window.addEventListener('resize', () => fitWords(root));
  update();
  // A page that has just been opened is given time to connect.
  setTimeout(() => {
    wasConnected = true;
    update();
  }, CONNECTS_WITHIN_MS);
  return { kinds: () => [...alarms.values()].map((alarm) => alarm.kind) };
}

/**
 * Return whether an alarm concerns the vehicle that this page drives or, without one, follows.
 * An alarm that is not about a vehicle concerns every page.
 */
function concerns({ subject }: Alarm, store: Store) {
  return store.vehicle(subject) === undefined
    || subject === (store.own[0] ?? window.crgame?.world?.followed ?? subject);
}

/** Return the page's own alarms: that the server has become silent. */
function ownAlarms(store: Store): Alarm[] {
  // After the end of a run the program may have ended too.
  return store.connected || store.status?.run === 'ended' ? [] : [{
    id: 'page-connection', kind: 'connection', subject: '',
    text: 'This page has lost its connection to the simulation and tries to get it back.',
  }];
}

function makeChip(alarm: Alarm): Chip {
  const says = element('span', { class: 'alarm-word' });
  const whom = element('span', { class: 'alarm-subject' });
  const chip = element('button', { type: 'button', class: 'alarm' }, icon(alarm.kind), says, whom);
  return { chip, says, whom };
}

function describe(entry: Shown, store: Store) {
  const [word, urgent] = KINDS.get(entry.kind) ?? [oneLine(entry.kind).replaceAll('_', ' '), true];
  entry.urgent = urgent;
  entry.chip.className = `alarm ${urgent ? 'urgent' : 'minor'}${entry.ended ? ' ended' : ''}`
    + `${entry.known ? ' known' : ''}`;
  entry.chip.dataset.kind = entry.kind;
  const since = Number.isFinite(entry.since_t) ? ` (since ${clockTime(entry.since_t)})` : '';
  entry.chip.title = `${oneLine(entry.text)}${since}`
    + (entry.known ? '' : ': click to acknowledge');
  setText(entry.says, word);
  // The text names the vehicle, but not the recorder.
  setText(entry.whom, store.vehicle(entry.subject)?.id ?? '');
}

/** Hide words, those of minor and ended alarms first, until all alarms fit. */
function fitWords(root: HTMLElement) {
  for (const words of ['all', 'urgent', 'none']) {
    root.dataset.words = words;
    // One pixel of tolerance for rounding.
    if (root.scrollWidth <= root.clientWidth + 1) {
      return;
    }
  }
}

function paint(frame: HTMLElement, signs: HTMLElement, alarms: Map<string, Shown>) {
  const all = [...alarms.values()].filter((alarm) => alarm.mine && !alarm.known);
  const active = all.filter((alarm) => !alarm.ended);
  const worst = ['urgent', 'minor'].find(
    (level) => all.some((alarm) => alarm.urgent === (level === 'urgent'))) ?? '';
  const relevant = all.filter((alarm) => alarm.urgent === (worst === 'urgent'));
  frame.hidden = worst === '';
  frame.className = worst;
  frame.classList.toggle('ended', !relevant.some((alarm) => !alarm.ended));
  frame.dataset.kind = (active.find((alarm) => relevant.includes(alarm)) ?? relevant[0])?.kind
    ?? '';
  const kinds = [...new Set(relevant.map((alarm) => alarm.kind))];
  if (signs.dataset.kinds !== kinds.join(' ')) {
    signs.dataset.kinds = kinds.join(' ');
    signs.className = worst;
    signs.replaceChildren(...kinds.map((kind) => icon(kind)));
  }
}
