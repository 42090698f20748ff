// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The seats in the Drive panel: their drivers, and taking and handing over a seat. */

import { element, setAttribute, setText } from './dom.js';
import { nameField } from './driving/name_field.js';
import { describeSeat } from './driving/seat_text.js';
import { reasonAgainstSeat, tellRefusal } from './rights.js';

import type { Connection } from './connection.js';
import type { Driving } from './driving/driving.js';
import type { Person, Reply, RequestMessage, SceneVehicle, Seat } from './messages.js';
import type { Store } from './store.js';

/** The facts of a row of the list. */
export interface Facts {
  id: string;
  role: SceneVehicle['role'];
  connected: boolean;
  mine: boolean;
  holder: string | null;
  left: boolean;
  requests: Person[];
  others: Person[];
  asked: boolean;
  offer: Person | null;
  offered: boolean; // to this person
  refused: string; // why this person cannot take a seat
  text: string;
  lost: boolean;
}

/** The list of seats, with the name field above and the input devices below. */
export class Seats {
  #store;
  #connection;
  #driving;
  #list = element('ul', { class: 'seats' });
  #news = element('p', { class: 'drive-news', role: 'status', 'aria-live': 'polite' });
  #shown = '';
  #before: Record<string, Seat> = {};
  // After a broken connection, the seats stay as they were until new ones arrive.
  #stale = false;
  #live;
  #replay;

  constructor(root: HTMLElement, store: Store, connection: Connection, driving: Driving) {
    this.#store = store;
    this.#connection = connection;
    this.#driving = driving;
    const seats = element('section', { class: 'drive-section', 'aria-labelledby': 'seats-title' },
      element('h2', { id: 'seats-title', text: 'Seats' }), this.#news, this.#list);
    const replay = element('p', { class: 'drive-note', hidden: true,
      text: 'This is a recording: its seats cannot be taken. Click a vehicle to follow it.' });
    this.#live = [nameField(store, connection), seats, driving.devices];
    this.#replay = replay;
    root.append(replay, ...this.#live);
    store.on('seats', () => {
      this.#stale = false;
      this.#show();
    });
    store.on(['hello', 'you', 'scene', 'status'], () => this.#show());
    store.on('connection', (connected) => connected || this.#disconnected());
    this.#show();
  }

  #show() {
    const { mode, seats } = this.#store;
    this.#live.forEach((node) => setAttribute(node, 'hidden', mode === 'replay'));
    setAttribute(this.#replay, 'hidden', mode !== 'replay');
    const rows = this.#order().map((id) => this.#facts(id));
    const none = this.#store.scene?.vehicles.length === 0
      ? 'This game has only traffic: there is no seat to take.'
      : 'No seats yet: waiting for the simulation.';
    const text = JSON.stringify([rows, none]);
    if (text !== this.#shown) {
      this.#shown = text;
      this.#rebuild(rows, none);
    }
    if (!this.#stale) {
      this.#announce(seats);
      this.#before = seats;
    }
  }

  #order() {
    const known = Object.keys(this.#store.seats);
    const inScene = (this.#store.scene?.vehicles ?? []).map(({ id }) => id);
    return [...inScene.filter((id) => known.includes(id)),
      ...known.filter((id) => !inScene.includes(id))];
  }

  #facts(id: string): Facts {
    const { seats, scene, me, status, rights } = this.#store;
    const connected = this.#store.connected && !this.#stale;
    const seat = seats[id];
    const role = this.#store.vehicle(id)?.role ?? 'human';
    return {
      id, role, connected, mine: connected && this.#store.holds(id),
      holder: seat.holder,
      // A seat that the game assigns to a cockpit cannot be given back to another driver.
      left: seat.holder === null && seat.source === 'cockpit' && seat.driver !== 'cockpit'
        && (!seat.kept || rights.directs),
      requests: seat.requests ?? [],
      others: seat.others ?? [],
      asked: (seat.requests ?? []).some(({ client }) => client === me.id),
      offer: seat.offer ?? null,
      offered: connected && seat.offer?.client === me.id,
      refused: reasonAgainstSeat(this.#store, id),
      text: connected ? describeSeat(seat, role, scene?.planners?.[id], me.id)
        : 'Unknown without a connection',
      lost: Boolean(seat.lost || status?.seats_lost?.[id]),
    };
  }

  #rebuild(rows: Facts[], none: string) {
    const focused = document.activeElement instanceof HTMLElement
      ? document.activeElement.dataset.key : undefined;
    this.#list.replaceChildren(...rows.map((facts) => this.#row(facts)));
    if (rows.length === 0) {
      this.#list.append(element('li', { class: 'drive-note', text: none }));
    }
    if (focused) {
      this.#list.querySelector<HTMLElement>(`[data-key="${CSS.escape(focused)}"]`)?.focus();
    }
  }

  #row(facts: Facts) {
    const { id, role, mine, lost, text } = facts;
    return element('li', { class: 'seat', 'data-seat': id, 'data-role': role, 'data-mine': mine,
      'data-lost': lost },
    element('span', { class: 'seat-colour', 'aria-hidden': 'true' }),
    element('div', { class: 'seat-text' },
      element('strong', { class: 'seat-id', text: id }),
      element('span', { class: 'seat-role',
        text: role === 'human' ? 'human seat' : 'autonomous vehicle' }),
      element('span', { class: 'seat-source', text }),
      lost ? element('span', { class: 'seat-lost', role: 'alert',
        text: 'No input: the vehicle brakes by itself' }) : null),
    element('div', { class: 'seat-buttons' }, ...this.#buttons(facts)));
  }

  #buttons(facts: Facts) {
    const { id, role, mine, holder, left, requests, others, asked, connected, refused } = facts;
    const button = (action: string, text: string, act: () => Promise<Reply>, title: string,
      enabled = connected): HTMLElement => element('button', {
      type: 'button', text, title: refused || title,
      class: `drive-button ${['claim', 'accept'].includes(action) ? 'primary' : ''}`,
      'data-action': action, 'data-key': `${id} ${text}`, disabled: !enabled || refused !== '',
      on: { click: () => this.#report(act()) } });
    const giveBack = button('release', 'Give back', () => this.#giveBack(id), role === 'human'
      ? 'Give the seat back to the driver that the game names'
      : 'Give the vehicle back to its planner');
    if (facts.offered) {
      return [
        button('accept', 'Accept', () => this.#request({ type: 'answer', seat: id, accept: true }),
          `Drive ${id} from now on; a seat that you have is given back`),
        button('decline', 'Decline',
          () => this.#request({ type: 'answer', seat: id, accept: false }),
          'The driver keeps the seat')];
    }
    if (mine && facts.offer !== null) {
      return [button('withdraw', 'Withdraw the offer',
        () => this.#request({ type: 'hand_over', seat: id, to: this.#store.me.id }),
        `${facts.offer.name} has not answered yet`), giveBack];
    }
    if (mine) {
      return [...requests.map(({ client, name }) => button('hand_over', `Hand over to ${name}`,
        () => this.#request({ type: 'hand_over', seat: id, to: client }),
        `${name} asks for this seat, and has to accept it`)),
      others.length > 0 ? this.#handOver(id, others, connected) : null,
      giveBack].filter((item) => item !== null);
    }
    if (holder !== null) {
      return [button('ask', asked ? 'Asked' : 'Ask for it',
        () => this.#request({ type: 'ask', seat: id }), 'Tell the driver that you want this seat',
        connected && !asked)];
    }
    const claim = role === 'human'
      ? button('claim', 'Drive', () => this.#driving.claim(id), `Drive ${id} from this page`)
      : button('claim', 'Take over', () => this.#driving.claim(id),
        `Drive ${id} instead of its planner`);
    return left ? [claim, giveBack] : [claim];
  }

  /** Return a selection of the persons that have not asked for the seat. */
  #handOver(id: string, others: Person[], connected: boolean) {
    const choice = element('select', { class: 'seat-hand-over', disabled: !connected,
      'aria-label': `Hand ${id} over to`, 'data-key': `${id} hand over`,
      on: { change: () => this.#report(
        this.#request({ type: 'hand_over', seat: id, to: choice.value })) } },
    element('option', { value: '', text: 'Hand over to …' }),
    ...others.map(({ client, name }) => element('option', { value: client, text: name })));
    return choice;
  }

  #giveBack(id: string) {
    return this.#driving.seat === id ? this.#driving.release()
      : this.#request({ type: 'release', seat: id });
  }

  #request(message: RequestMessage) {
    return this.#connection.request(message);
  }

  #report(reply: Promise<Reply>) {
    return tellRefusal(this.#store, reply);
  }

  #disconnected() {
    if (this.#stale) {
      return;
    }
    const lost = this.#store.own;
    this.#stale = true;
    this.#before = {};
    setText(this.#news, lost.length > 0
      ? `The connection broke: ${lost.join()} is kept for you for a minute.` : '');
    this.#show();
  }

  /** Show what changed for this person since the last document. */
  #announce(seats: Record<string, Seat>) {
    const { me } = this.#store;
    for (const [id, seat] of Object.entries(seats)) {
      const before = this.#before[id];
      const had = before?.holder === me.id && me.id !== '';
      if (seat.holder === me.id && me.id !== '' && !had) {
        setText(this.#news, `You drive ${id}.`);
      } else if (had && seat.holder !== me.id) {
        setText(this.#news, seat.holder === null ? `${id} is given back.`
          : `${id} is now driven by ${seat.holder_name}.`);
      } else if (seat.offer?.client === me.id && before?.offer?.client !== me.id) {
        setText(this.#news, `${seat.holder_name} offers you ${id}.`);
      } else if (had && before.offer && !seat.offer) {
        setText(this.#news, `You keep ${id}.`);
      } else if (had && (seat.requests?.length ?? 0) > (before.requests?.length ?? 0)) {
        setText(this.#news, `${seat.requests?.at(-1)?.name} asks for ${id}.`);
      }
    }
  }
}
