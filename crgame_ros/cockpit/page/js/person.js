// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Which page this is: its key, by which the server knows it again after a lost connection. */

/** @import { Connection } from './connection.js' */
/** @import { Store } from './store.js' */

const KEY = 'crgame.key';

/** The key of this tab, and of the tab to come once it has been closed. */
class Person {
  #connection;
  // Whoever gives out the address of a stage may say who its driver is, whatever the browser.
  #given = givenKey();
  // Of a tab that was open before: another tab may have it, and keeps it then.
  #fresh = this.#given === null && sessionStorage.getItem(KEY) === null;
  #key = this.#given ?? sessionStorage.getItem(KEY) ?? localStorage.getItem(KEY) ?? newKey();

  /**
   * @param {Store} store
   * @param {Connection} connection
   */
  constructor(store, connection) {
    this.#connection = connection;
    store.on('hello', () => this.#introduce());
    store.on('you', ({ accepted }) => accepted || this.#beAnother());
    if (store.me.id !== '') {
      this.#introduce();
    }
  }

  /** @returns {Record<string, string>} what names this page in requests */
  get headers() {
    return { 'X-Crgame-Key': this.#key };
  }

  #introduce() {
    if (this.#given === null) {
      sessionStorage.setItem(KEY, this.#key);
      if (localStorage.getItem(KEY) === null) {
        localStorage.setItem(KEY, this.#key);
      }
    }
    this.#connection.send({ type: 'person', key: this.#key, fresh: this.#fresh });
    // From now on a connection that comes back is this tab's.
    this.#fresh = false;
  }

  #beAnother() {
    this.#given = null;
    this.#key = newKey();
    this.#introduce();
  }
}

/** @returns {string|null} the key that the address gives */
function givenKey() {
  const key = new URLSearchParams(window.location.search).get('key') ?? '';
  return /^[0-9a-f]{32}$/.test(key) ? key : null;
}

/** 128 random bits; randomUUID is there on safe origins alone. */
function newKey() {
  return [...crypto.getRandomValues(new Uint8Array(16))]
    .map((byte) => byte.toString(16).padStart(2, '0')).join('');
}

/**
 * Tell the server who is back.
 *
 * @param {HTMLElement} _ no part of the page
 * @param {Store} store
 * @param {Connection} connection
 * @returns {Person}
 */
export function createPerson(_, store, connection) {
  return new Person(store, connection);
}
