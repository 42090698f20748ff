// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A WebSocket to this page's server, which reconnects by itself and is pinged once a second. */

const FIRST_RETRY_MS = 250;
const LAST_RETRY_MS = 2000;
const PING_EVERY_MS = 1000;
const LONGEST_TOLD_MS = 60_000;

/** What is called; `pinged` returns the last round-trip time and what else a ping tells. */
interface Listener {
  opened: () => void;
  lost: () => void;
  received: (data: ArrayBuffer | string) => void;
  pinged: () => { round_trip_ms: number };
}

/** One page's socket. */
export class Socket {
  #url;
  #listener;
  #socket: WebSocket | null = null;
  #retry_ms = FIRST_RETRY_MS;
  #retryTimer = 0;
  #pings;
  #closed = false;

  /** `path` beside the page's own: a replay has an address below the cockpit's. */
  constructor(path: string, listener: Listener) {
    const url = new URL(path, window.location.href);
    url.protocol = url.protocol === 'https:' ? 'wss:' : 'ws:';
    this.#url = url.href;
    this.#listener = listener;
    this.#open();
    this.#pings = setInterval(() => this.ping(), PING_EVERY_MS);
  }

  /** Return whether the server can be reached now. */
  get open() {
    return this.#socket?.readyState === WebSocket.OPEN;
  }

  /** Send a message; return false when there is no connection. */
  send(message: { type: string }): boolean {
    if (!this.open) {
      return false;
    }
    this.#socket?.send(JSON.stringify(message));
    return true;
  }

  /** Send a ping, by whose round-trip time others see how good the connection is. */
  ping() {
    const { round_trip_ms, ...more } = this.#listener.pinged();
    this.send({ type: 'ping', t: performance.now(), ...more, ...Number.isFinite(round_trip_ms)
      ? { round_trip_ms: Math.min(round_trip_ms, LONGEST_TOLD_MS) } : {} } as { type: string });
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

  #open() {
    const socket = new WebSocket(this.#url);
    socket.binaryType = 'arraybuffer';
    socket.addEventListener('open', () => {
      this.#retry_ms = FIRST_RETRY_MS;
      this.#listener.opened();
    });
    socket.addEventListener('message', ({ data }) => this.#listener.received(data));
    socket.addEventListener('close', () => this.#lost());
    this.#socket = socket;
  }

  #lost() {
    this.#listener.lost();
    if (!this.#closed) {
      this.#retryTimer = setTimeout(() => this.#open(), this.#retry_ms);
      this.#retry_ms = Math.min(2 * this.#retry_ms, LAST_RETRY_MS);
    }
  }
}
