// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The connection to the cockpit's server, which feeds the store. */

import { Socket } from './socket.js';

import type { PageMessage, Reply, RequestMessage, ServerMessage } from './messages.js';
import type { Store } from './store.js';

const REPLY_WITHIN_MS = 10000;

/** One page's connection to the server. */
export class Connection {
  #store;
  socket;
  #pending = new Map<number, { resolve: (reply: Reply) => void; timer: number }>();
  #lastId = 0;

  /** `store` is told everything that arrives. */
  constructor(store: Store) {
    this.#store = store;
    this.socket = new Socket('ws', {
      opened: () => store.setConnected(true),
      lost: () => this.#lost(),
      received: (data) => this.#receive(data),
      pinged: () => ({ round_trip_ms: store.round_trip_ms }),
    });
  }

  /** Send a message that needs no answer; return false when there is no connection. */
  send(message: PageMessage): boolean {
    return this.socket.send(message);
  }

  /** Send a message, with an `id`, and wait for the server's reply; never reject. */
  request(message: RequestMessage): Promise<Reply> {
    this.#lastId += 1;
    const id = this.#lastId;
    if (!this.send({ ...message, id })) {
      return Promise.resolve({ ok: false, text: 'There is no connection to the simulation.' });
    }
    return new Promise((resolve) => {
      const timer = setTimeout(() => this.#settle(
        id, { ok: false, text: 'The simulation did not answer within 10 s.' }), REPLY_WITHIN_MS);
      this.#pending.set(id, { resolve, timer });
    });
  }

  #lost() {
    for (const id of [...this.#pending.keys()]) {
      this.#settle(id, { ok: false, text: 'The connection broke before the answer came.' });
    }
    this.#store.setConnected(false);
    this.#store.serverClock.forget();
  }

  #receive(data: ArrayBuffer | string) {
    if (data instanceof ArrayBuffer) {
      this.#store.receiveFrame(data, performance.now());
      return;
    }
    const message: ServerMessage = JSON.parse(data);
    if (message.type === 'reply') {
      this.#settle(message.to, message);
    } else if (message.type === 'pong') {
      const now_ms = performance.now();
      this.#store.round_trip_ms = now_ms - message.t;
      this.#store.serverClock.add(message.t, now_ms, message.steady_s);
    } else {
      this.#store.receive(message);
    }
  }

  #settle(id: number, reply: Reply) {
    const waiting = this.#pending.get(id);
    if (waiting !== undefined) {
      this.#pending.delete(id);
      clearTimeout(waiting.timer);
      waiting.resolve(reply);
    }
  }
}
