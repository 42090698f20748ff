// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The WebSocket to the cockpit's server, which reconnects by itself and feeds the store. */

import type { PageMessage, Reply, RequestMessage, ServerMessage } from './messages.js';
import type { Store } from './store.js';

const FIRST_RETRY_MS = 250;
const LAST_RETRY_MS = 2000;
const REPLY_WITHIN_MS = 10000;
const PING_EVERY_MS = 1000;
const LONGEST_TOLD_MS = 60000;

/** One page's connection to the server. */
export class Connection {
  #store;
  #url;
  #socket: WebSocket | null = null;
  #pending = new Map<number, { resolve: (reply: Reply) => void; timer: number }>();
  #lastId = 0;
  #retry_ms = FIRST_RETRY_MS;
  #retryTimer = 0;
  #pings = 0;
  #closed = false;

  /**
   * @param store told everything that arrives
   * @param url of the WebSocket; that of this page's server by default
   */
  constructor(store: Store, url = socketUrl(window.location)) {
    this.#store = store;
    this.#url = url;
    this.#open();
    this.#pings = setInterval(
      () => this.#ping(), PING_EVERY_MS);
  }

  /** Return whether the server can be reached now. */
  get open() {
    return this.#socket?.readyState === WebSocket.OPEN;
  }

  /** Send a message that needs no answer; return false when there is no connection. */
  send(message: PageMessage): boolean {
    if (!this.open) {
      return false;
    }
    this.#socket?.send(JSON.stringify(message));
    return true;
  }

  /**
   * Send a message and wait for the server's reply.
   * @param message with its `type`; gets its `id` here
   * @returns never rejects
   */
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

  /** Drop the connection, which is then restored at once. */
  interrupt() {
    this.#socket?.close();
  }

  /** Close for good. */
  close() {
    this.#closed = true;
    clearInterval(this.#pings);
    clearTimeout(this.#retryTimer);
    this.#socket?.close();
  }

  /** Send a ping with the last round-trip time, which the others can see. */
  #ping() {
    const { round_trip_ms } = this.#store;
    const t = performance.now();
    this.send(Number.isFinite(round_trip_ms)
      ? { type: 'ping', t, round_trip_ms: Math.min(round_trip_ms, LONGEST_TOLD_MS) }
      : { type: 'ping', t });
  }

  #open() {
    const socket = new WebSocket(this.#url);
    socket.binaryType = 'arraybuffer';
    socket.addEventListener('open', () => {
      this.#retry_ms = FIRST_RETRY_MS;
      this.#store.setConnected(true);
    });
    socket.addEventListener('message', (event) => this.#receive(event.data));
    socket.addEventListener('close', () => this.#lost());
    this.#socket = socket;
  }

  #lost() {
    for (const id of [...this.#pending.keys()]) {
      this.#settle(id, { ok: false, text: 'The connection broke before the answer came.' });
    }
    this.#store.setConnected(false);
    this.#store.serverClock.forget();
    if (!this.#closed) {
      this.#retryTimer = setTimeout(() => this.#open(), this.#retry_ms);
      this.#retry_ms = Math.min(2 * this.#retry_ms, LAST_RETRY_MS);
    }
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

/**
 * Return the socket's address beside a page's: a replay has an address below the cockpit's.
 * @param location of the page
 */
function socketUrl(location: Location) {
  const url = new URL('ws', location.href);
  url.protocol = url.protocol === 'https:' ? 'wss:' : 'ws:';
  return url.href;
}
