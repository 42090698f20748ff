// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The panel from which an experimenter triggers the events of the game. */

import { element, setAttribute, setText } from '../dom.js';
import { reasonAgainst } from '../rights.js';
import { conditionWords, eventKind, eventWords } from './event_words.js';
import { clockTime, oneLine } from './format.js';
import { icon } from './icons.js';

import type { Connection } from '../connection.js';
import type { FiredEvent, GameEvent } from '../messages.js';
import type { Store } from '../store.js';

const BY = new Map([['trigger', 'by button'], ['condition', 'by its condition'],
  ['driver', 'by its driver'], ['contact', 'stopped by it']]);

/**
 * Make the panel.
 *
 * @param root #panel-events
 * @returns trigger an event by its name
 */
export function createEvents(root: HTMLElement, store: Store,
  connection: Connection): { trigger: (name: string) => Promise<void> } {
  const list = element('ul', { class: 'event-list' });
  const log = element('ol', { class: 'event-log' });
  const logTitle = element('h2', { text: 'What has happened' });
  const empty = element('p', { class: 'hint' });
  root.append(element('h2', { text: 'Trigger an event' }), empty, list, logTitle, log);
  const cards = new Map<string, ReturnType<typeof makeCard>>();
  const asked = new Set<string>();

  const update = () => {
    const fired = new Map(store.fired.map((entry) => [entry.name, entry]));
    for (const [name, card] of cards) {
      card.update(fired.get(name), asked.has(name), steerable(store), store);
      card.explain(reasonAgainst(store, 'direct', 'trigger events'));
    }
    logTitle.hidden = store.fired.length === 0;
    log.replaceChildren(...[...store.fired].reverse().map((entry) => element('li', {},
      element('span', { class: 'time', text: clockTime(timeOf(entry, store)) }),
      element('span', { text: cards.get(entry.name)?.label ?? entry.name }),
      element('span', { class: 'dim', text: BY.get(entry.by) ?? entry.by }))));
  };
  const rebuild = () => {
    asked.clear();
    cards.clear();
    for (const event of store.scene?.events ?? []) {
      cards.set(event.name, makeCard(event, () => trigger(event.name)));
    }
    list.replaceChildren(...[...cards.values()].map((card) => card.root));
    empty.hidden = cards.size > 0;
    setText(empty, store.scene === null ? 'No scenario yet.'
      : 'This game has no events. They are written under "events" in the game file.');
    update();
  };
  const trigger = async (name: string) => {
    asked.add(name);
    cards.get(name)?.refused('');
    update();
    const reply = await connection.request({ type: 'trigger', event: name });
    if (!reply.ok) {
      asked.delete(name);
      cards.get(name)?.refused(oneLine(reply.text));
      update();
    }
  };
  let run = '';
  store.on('scene', rebuild);
  store.on('epoch', rebuild);
  store.on('events', update);
  store.on('hello', update);
  store.on('you', update);
  store.on('connection', update);
  store.on('status', (status) => {
    if (status.run !== run) {
      run = status.run;
      update();
    }
  });
  rebuild();
  return { trigger };
}

function steerable(store: Store) {
  return store.mode === 'live' && store.connected && store.status?.run !== 'ended'
    && store.rights.directs;
}

function timeOf(entry: FiredEvent, store: Store) {
  return entry.n * (store.scene?.time.dt_s ?? NaN);
}

function makeCard(event: GameEvent, press: () => void) {
  const label = oneLine(event.label || event.name);
  const button = element('button', { type: 'button', class: 'primary', on: { click: press } });
  const state = element('p', { class: 'event-state' });
  const error = element('p', { class: 'field-error', role: 'alert' });
  const by = conditionWords(event.when);
  return {
    label,
    root: element('li', { class: 'card event' },
      element('div', { class: 'event-head' },
        element('div', {},
          element('h3', { text: label }),
          element('span', { class: 'tag', text: eventKind(event) })), button),
      element('p', { text: eventWords(event) }),
      by ? element('p', { class: 'dim event-when' }, icon('clock'), `Also ${by}.`) : null,
      state, error),
    refused: (text: string) => setText(error, text),
    /** @param reason why it cannot be pressed, or empty */
    explain: (reason: string) => setAttribute(button, 'title', reason || null),
    update(fired: FiredEvent | undefined, asked: boolean, can: boolean, store: Store) {
      button.disabled = fired !== undefined || asked || !can;
      button.setAttribute('aria-label', `Trigger ${label}`);
      const text = fired ? 'Done' : asked ? 'Sent …' : 'Trigger';
      if (button.textContent !== text) {
        button.replaceChildren(icon(fired ? 'check' : 'bolt'), text);
      }
      setText(state, fired
        ? `${clockTime(timeOf(fired, store))}, ${BY.get(fired.by) ?? fired.by}` : '');
    },
  };
}
