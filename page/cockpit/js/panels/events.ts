// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The panel from which an experimenter triggers the events of the game. */

import { element, setText } from '../dom.js';
import { conditionWords, eventKind, eventWords } from './event_words.js';
import { clockTime, oneLine } from './format.js';
import { icon } from './icons.js';
import { TriggerCards } from './trigger_cards.js';

import type { Connection } from '../connection.js';
import type { FiredEvent, GameEvent } from '../messages.js';
import type { Store } from '../store.js';

const BY = new Map([['trigger', 'by button'], ['condition', 'by its condition'],
  ['driver', 'by its driver'], ['contact', 'stopped by it']]);

/** Make the panel; return what triggers an event by its name. */
export function createEvents(root: HTMLElement, store: Store,
  connection: Connection): { trigger: (name: string) => Promise<void> } {
  const log = element('ol', { class: 'event-log' });
  const logTitle = element('h2', { text: 'What has happened' });
  const empty = element('p', { class: 'hint' });
  const timeOf = ({ n }: FiredEvent) => clockTime(n * (store.scene?.time.dt_s ?? NaN));
  const cards = new TriggerCards<GameEvent>(store, connection, {
    deed: 'trigger events',
    items: () => store.scene?.events ?? [],
    about: (event) => {
      const by = conditionWords(event.when);
      return { tag: eventKind(event), more: [element('p', { text: eventWords(event) }),
        by ? element('p', { class: 'dim event-when' }, icon('clock'), `Also ${by}.`) : null] };
    },
    now: ({ name }, asked) => {
      const fired = store.fired.findLast((entry) => entry.name === name);
      return { text: fired ? 'Done' : asked ? 'Sent …' : 'Trigger', name: 'Trigger',
        icon: fired ? 'check' : 'bolt', done: fired !== undefined || asked,
        state: fired ? `${timeOf(fired)}, ${BY.get(fired.by) ?? fired.by}` : '' };
    },
  });
  root.append(element('h2', { text: 'Trigger an event' }), empty, cards.list, logTitle, log);

  const update = () => {
    cards.update();
    const labels = new Map(store.scene?.events.map(({ name, label }) => [name, label]));
    logTitle.hidden = store.fired.length === 0;
    log.replaceChildren(...[...store.fired].reverse().map((entry) => element('li', {},
      element('span', { class: 'time', text: timeOf(entry) }),
      element('span', { text: oneLine(labels.get(entry.name) || entry.name) }),
      element('span', { class: 'dim', text: BY.get(entry.by) ?? entry.by }))));
  };
  const rebuild = () => {
    empty.hidden = cards.rebuild() > 0;
    setText(empty, store.scene === null ? 'No scenario yet.'
      : 'This game has no events. They are written under "events" in the game file.');
    update();
  };
  store.on(['scene', 'epoch'], rebuild);
  store.on(['events', 'hello', 'you', 'connection', 'run'], update);
  rebuild();
  return { trigger: (name) => cards.trigger(name) };
}
