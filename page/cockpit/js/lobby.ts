// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The lobby before a run with drivers: the ready drivers, and the countdown over the picture. */

import { element, setAttribute, setText } from './dom.js';
import { describeSeat } from './driving/seat_text.js';
import { tellRefusal } from './rights.js';

import type { Connection } from './connection.js';
import type { RequestMessage, Seat } from './messages.js';
import type { Store } from './store.js';

/** The lobby in the Drive panel and the countdown on the stage. */
export class Lobby {
  #store;
  #connection;
  #list = element('ul', { class: 'lobby-seats' });
  #note = element('p', { class: 'drive-note', role: 'status' });
  #ready = element('button', { type: 'button', class: 'drive-button primary wide',
    on: { click: () => this.#toggleReady() } });
  #all = element('button', { type: 'button', class: 'drive-button', text: 'Start for all',
    title: 'Begin as soon as everybody has the hands on the controls',
    on: { click: () => this.#request({ type: 'control', action: 'start', all: true }) } });
  #section = element('section', { class: 'drive-section lobby', hidden: true,
    'aria-labelledby': 'lobby-title' },
  element('h2', { id: 'lobby-title', text: 'Before the start' }), this.#list, this.#note,
  this.#ready, this.#all);
  #countdown = element('div', { class: 'countdown', role: 'timer', 'aria-live': 'assertive',
    hidden: true });

  constructor(stage: HTMLElement, store: Store, connection: Connection) {
    this.#store = store;
    this.#connection = connection;
    stage.append(this.#countdown);
    document.querySelector('#panel-drive')?.prepend(this.#section);
    store.on(['hello', 'you', 'seats', 'status', 'connection'], () => this.#show());
    this.#show();
  }

  /** @returns the seats that the game leaves to people at pages */
  get #seats(): [string, Seat][] {
    return Object.entries(this.#store.seats).filter(
      ([, { driver, source }]) => driver === 'cockpit' && source === 'cockpit');
  }

  /** @returns the seat that this page holds */
  get #mine(): string | undefined {
    return this.#seats.find(([id]) => this.#store.holds(id))?.[0];
  }

  #show() {
    const { status, connected, mode, rights, seats } = this.#store;
    const seconds = connected ? status?.countdown_s ?? 0 : 0;
    setAttribute(this.#countdown, 'hidden', seconds === 0);
    setText(this.#countdown, seconds > 0 ? String(seconds) : '');
    const waits = mode === 'live' && connected && status?.n === 0
      && ['waiting', 'paused'].includes(status.run) && this.#seats.length > 0;
    setAttribute(this.#section, 'hidden', !waits);
    if (!waits) {
      return;
    }
    this.#list.replaceChildren(...this.#seats.map(([id, seat]) => this.#row(id, seat)));
    const missing = this.#seats.filter(([, { holder, ready }]) => holder === null || !ready);
    setText(this.#note, seconds > 0 ? 'Get ready: the run is starting.'
      : missing.length > 0 ? 'The run begins after a countdown when all are ready.'
        : 'All are ready: the run is starting.');
    const mine = this.#mine;
    const ready = mine !== undefined && Boolean(seats[mine].ready);
    setAttribute(this.#ready, 'hidden', mine === undefined);
    setText(this.#ready, ready ? 'Withdraw ready' : 'Ready');
    setAttribute(this.#ready, 'aria-pressed', String(ready));
    setAttribute(this.#all, 'hidden', !rights.directs || this.#seats.length < 2);
  }

  #row(id: string, seat: Seat) {
    const { me } = this.#store;
    const state = seat.holder === null ? 'free' : seat.ready ? 'ready' : 'not ready yet';
    return element('li', { 'data-ready': Boolean(seat.ready) && seat.holder !== null },
      element('strong', { text: id }),
      element('span', { text: describeSeat(seat, 'human', undefined, me.id) }),
      element('span', { class: 'lobby-state', text: state }));
  }

  #toggleReady() {
    const seat = this.#mine;
    if (seat !== undefined) {
      this.#ready.blur();
      this.#request({ type: 'ready', seat, ready: !this.#store.seats[seat].ready });
    }
  }

  #request(message: RequestMessage) {
    return tellRefusal(this.#store, this.#connection.request(message));
  }
}
