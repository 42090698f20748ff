// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The connection to the desk's server, with an estimate of the server's clock. */

import { ServerClock } from '../../cockpit/js/server_clock.js';
import { Socket } from '../../cockpit/js/socket.js';

import type { PongMessage } from './desk_messages.js';
import type { ExperimenterMessage, ParticipantMessage, Ping } from './page_messages.js';

/** `pinged` returns the data to send with each ping. */
export interface Listener<Message> {
  opened: (again: boolean) => void;
  lost: () => void;
  received: (message: Message) => void;
  pinged?: () => Partial<Ping>;
}

/** One page's connection, on which it gets its own kinds of messages, and pongs. */
export class DeskConnection<Message extends { type: string }> {
  #listener;
  #socket;
  #opened = false;
  #clock = new ServerClock();
  // Until the first pong: its server may run on another machine.
  #anew = true;
  /** The round-trip time [ms]; NaN before it is known. */
  round_trip_ms = NaN;

  /** `path` of the WebSocket. */
  constructor(path: string, listener: Listener<Message>) {
    this.#listener = listener;
    this.#socket = new Socket(path, {
      opened: () => this.#begin(),
      lost: () => listener.lost(),
      received: (data) => this.#receive(JSON.parse(data as string)),
      pinged: () => ({ ...listener.pinged?.(), round_trip_ms: this.round_trip_ms }),
    });
  }

  /** The server's clock now [s since 1970], by the page's estimate. */
  get now_s() {
    const now_ms = performance.now();
    return this.#clock.at(now_ms)?.steady_s ?? (performance.timeOrigin + now_ms) / 1000;
  }

  /** Send a message; return false when there is no connection. */
  send(message: ParticipantMessage | ExperimenterMessage): boolean {
    return this.#socket.send(message);
  }

  #begin() {
    this.#anew = true;
    this.#socket.ping();
    this.#listener.opened(this.#opened);
    this.#opened = true;
  }

  #receive(message: Message | PongMessage) {
    if (message.type !== 'pong') {
      this.#listener.received(message as Message);
      return;
    }
    const { t, at } = message as PongMessage;
    const now_ms = performance.now();
    this.round_trip_ms = now_ms - t;
    if (this.#anew) {
      this.#clock.forget();
      this.#anew = false;
    }
    this.#clock.add(t, now_ms, at);
  }
}
