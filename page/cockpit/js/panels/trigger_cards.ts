// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Cards with a button each, from which an experimenter triggers what a game defines. */

import { element, setAttribute, setText } from '../dom.js';
import { reasonAgainst } from '../rights.js';
import { oneLine } from './format.js';
import { icon } from './icons.js';

import type { Connection } from '../connection.js';
import type { Store } from '../store.js';

export interface Kind<Item> {
  deed: string; // of the button, as in 'trigger events'
  items: () => Item[]; // of the scene
  about: (item: Item) => { tag: string; more: (Node | null)[] }; // what stays
  now: (item: Item, asked: boolean) => { text: string; name: string; state: string;
    icon: string; done: boolean }; // the button's text and its beginning in words, and the state
}

/** All cards of one kind; `update` shows what has changed. */
export class TriggerCards<Item extends { name: string; label: string }> {
  list = element('ul', { class: 'event-list' });
  #store;
  #connection;
  #kind;
  #cards = new Map<string, { update: () => void; refused: (text: string) => void }>();
  #asked = new Set<string>();

  constructor(store: Store, connection: Connection, kind: Kind<Item>) {
    this.#store = store;
    this.#connection = connection;
    this.#kind = kind;
  }

  /** Make the cards of the scene, none of which has been pressed; return how many. */
  rebuild(): number {
    this.#asked.clear();
    this.#cards.clear();
    this.list.replaceChildren(...this.#kind.items().map((item) => this.#card(item)));
    return this.#cards.size;
  }

  update() {
    this.#cards.forEach((card) => card.update());
  }

  /** Send the request and show its refusal at the card. */
  async trigger(name: string): Promise<void> {
    const card = this.#cards.get(name);
    this.#asked.add(name);
    card?.refused('');
    card?.update();
    const { ok, text } = await this.#connection.request({ type: 'trigger', event: name });
    if (!ok) {
      this.#asked.delete(name);
      card?.refused(oneLine(text));
      card?.update();
    }
  }

  #card(item: Item) {
    const label = oneLine(item.label || item.name);
    const { tag, more } = this.#kind.about(item);
    const button = element('button', { type: 'button', class: 'primary',
      on: { click: () => this.trigger(item.name) } });
    const state = element('p', { class: 'event-state' });
    const error = element('p', { class: 'field-error', role: 'alert' });
    this.#cards.set(item.name, {
      refused: (text) => setText(error, text),
      update: () => {
        const { mode, connected, status, rights } = this.#store;
        const now = this.#kind.now(item, this.#asked.has(item.name));
        button.disabled = now.done || mode !== 'live' || !connected || status?.run === 'ended'
          || !rights.directs;
        const reason = reasonAgainst(this.#store, 'direct', this.#kind.deed);
        setAttribute(button, 'title', reason || null);
        setAttribute(button, 'aria-label', `${now.name} ${label}`);
        if (button.textContent !== now.text) {
          button.replaceChildren(icon(now.icon), now.text);
        }
        setText(state, now.state);
      },
    });
    return element('li', { class: 'card event', 'data-name': item.name },
      element('div', { class: 'event-head' },
        element('div', {}, element('h3', { text: label }),
          element('span', { class: 'tag', text: tag })), button),
      ...more, state, error);
  }
}
