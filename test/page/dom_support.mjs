// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A document of happy-dom for tests of panels, with a store and a server that answers. */

import { setImmediate as nextTurn } from 'node:timers/promises';

import { Window } from 'happy-dom';

import { Store } from '../../page/cockpit/js/store.js';

const GLOBALS = ['document', 'localStorage', 'navigator', 'location', 'CSS', 'MutationObserver',
  'Node', 'Element', 'HTMLElement', 'HTMLInputElement', 'HTMLSelectElement', 'Event',
  'KeyboardEvent', 'MouseEvent', 'CustomEvent', 'getComputedStyle'];

/**
 * Make an empty page the global document of this test file.
 *
 * @param {string} [html] content of its body
 * @returns {HTMLElement} the body
 */
export function openPage(html = '') {
  const window = new Window({ url: 'http://127.0.0.1:8080/' });
  globalThis.window = window;
  expose(...GLOBALS);
  document.write(`<!DOCTYPE html><html><body>${html}</body></html>`);
  return document.body;
}

/** A server's connection: keeps the requests, and answers each with `reply`. */
export class Server {
  reply = { ok: true, text: '' };
  requests = [];

  async request(message) {
    this.requests.push(message);
    return this.reply;
  }

  /** Return the requests since the last call. */
  take() {
    return this.requests.splice(0);
  }
}

/**
 * Make a connected store of a live run, for a person who drives and directs.
 *
 * @param {object[]} vehicles of the scene
 * @param {object} [more] further parts of the scene
 * @returns {Store}
 */
export function liveStore(vehicles, more = {}) {
  const store = new Store();
  store.receive({ type: 'hello', client: 'c1', name: 'Ada', mode: 'live', version: '1',
    rights: { role: 'director', directs: true, drives: true, seat: '', may_direct: true,
      may_drive: true } });
  store.setConnected(true);
  store.receive({ type: 'scene', time: { epoch: 0, dt_s: 0.01, dt_c_s: 0.1 }, vehicles,
    objects: [], events: [], ...more });
  return store;
}

/** Rights of a spectator and of a driver, for `you` messages. */
export const RIGHTS = {
  watch: { role: 'spectator', directs: false, drives: false, seat: '', may_direct: false,
    may_drive: false },
  drive: { role: 'driver', directs: false, drives: true, seat: '', may_direct: false,
    may_drive: true },
};

/**
 * Click an element as a person does: a disabled one does nothing.
 *
 * @param {Element|null} node
 */
export async function click(node) {
  node.click();
  await nextTurn();
}

/**
 * Return the visible text of an element, without that of hidden parts.
 *
 * @param {Element} node
 * @returns {string}
 */
export function textOf(node) {
  if (node.nodeType === 3) {
    return node.textContent;
  }
  if (node.hasAttribute('hidden')) {
    return '';
  }
  return [...node.childNodes].map(textOf).join(' ').replace(/\s+/g, ' ').trim();
}

/**
 * Make further names of the open page's window global.
 *
 * @param {...string} names
 */
export function expose(...names) {
  for (const name of names) {
    Object.defineProperty(globalThis, name,
      { value: globalThis.window[name], configurable: true, writable: true });
  }
}

/** The page's clock and animation frames, which only a test moves. */
export class Pictures {
  now_ms = 1000;
  #waiting = new Map();
  #asked = 0;

  constructor() {
    performance.now = () => this.now_ms;
    globalThis.requestAnimationFrame = (draw) => {
      this.#asked += 1;
      this.#waiting.set(this.#asked, draw);
      return this.#asked;
    };
    globalThis.cancelAnimationFrame = (number) => this.#waiting.delete(number);
  }

  /** Return how many functions wait for the next frame. */
  get waiting() {
    return this.#waiting.size;
  }

  /**
   * Move the clock on, and draw one frame.
   *
   * @param {number} [by_ms]
   */
  draw(by_ms = 20) {
    this.now_ms += by_ms;
    const waiting = [...this.#waiting.values()];
    this.#waiting.clear();
    waiting.forEach((draw) => draw(this.now_ms));
  }
}

/**
 * Send an event as a browser does.
 *
 * @param {EventTarget} target
 * @param {string} type
 * @param {object} [values] of the event, such as `key` or `timeStamp`
 * @returns {Event} the event, for `defaultPrevented`
 */
export function send(target, type, values = {}) {
  const { Event } = globalThis.window;
  const event = new Event(type, { bubbles: true, cancelable: true });
  for (const [name, value] of Object.entries(values)) {
    Object.defineProperty(event, name, { value, configurable: true });
  }
  target.dispatchEvent(event);
  return event;
}
