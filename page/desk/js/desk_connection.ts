// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The WebSocket to the desk's server: it reconnects and estimates the server's clock. */

import { ServerClock } from '../../cockpit/js/server_clock.js';

import type { PongMessage } from './desk_messages.js';
import type { ExperimenterMessage, ParticipantMessage, Ping } from './page_messages.js';

const FIRST_RETRY_MS = 250;
const LAST_RETRY_MS = 2000;
const PING_EVERY_MS = 1000;
const LONGEST_TOLD_MS = 60_000;

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
  #url;
  #socket: WebSocket | null = null;
  #retry_ms = FIRST_RETRY_MS;
  #opened = false;
  #clock = new ServerClock();
  // Until the first pong: its server may run on another machine.
  #anew = true;
  /** The round-trip time [ms]; NaN before it is known. */
  round_trip_ms = NaN;

  /** @param path of the WebSocket */
  constructor(path: string, listener: Listener<Message>) {
    this.#listener = listener;
    const url = new URL(path, window.location.href);
    url.protocol = url.protocol === 'https:' ? 'wss:' : 'ws:';
    this.#url = url.href;
    this.#open();
    setInterval(() => this.#ping(), PING_EVERY_MS);
  }

  /** The server's clock now [s since 1970], by the page's estimate. */
  get now_s() {
    const now_ms = performance.now();
    return this.#clock.at(now_ms)?.steady_s ?? (performance.timeOrigin + now_ms) / 1000;
  }

  /** @returns false when there is no connection */
  send(message: ParticipantMessage | ExperimenterMessage): boolean {
    if (this.#socket?.readyState !== WebSocket.OPEN) {
      return false;
    }
    this.#socket.send(JSON.stringify(message));
    return true;
  }

  #open() {
    const socket = new WebSocket(this.#url);
    socket.addEventListener('open', () => {
      this.#retry_ms = FIRST_RETRY_MS;
      this.#anew = true;
      this.#ping();
      this.#listener.opened(this.#opened);
      this.#opened = true;
    });
    socket.addEventListener('message', ({ data }) => this.#receive(JSON.parse(data)));
    socket.addEventListener('close', () => {
      this.#listener.lost();
      setTimeout(() => this.#open(), this.#retry_ms);
      this.#retry_ms = Math.min(2 * this.#retry_ms, LAST_RETRY_MS);
    });
    this.#socket = socket;
  }

  #ping() {
    const more = this.#listener.pinged?.() ?? {};
    const { round_trip_ms } = this;
    this.send({ type: 'ping', t: performance.now(), ...more, ...Number.isFinite(round_trip_ms)
      ? { round_trip_ms: Math.min(round_trip_ms, LONGEST_TOLD_MS) } : {} });
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
