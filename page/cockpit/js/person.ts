// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The key of this page, by which the server recognises it after a lost connection. */

import { isKey, local, newKey, session } from './panels/memory.js';

import type { Connection } from './connection.js';
import type { Store } from './store.js';

const KEY = 'crgame.key';

/** The key of this tab, and of its successor after it has been closed. */
export class Person {
  #connection;
  // The address of a stage may carry the key of its driver, whatever the browser.
  #given = givenKey();
  // The key of an earlier tab: if another open tab has it, that tab keeps it.
  #fresh = this.#given === null && session.get(KEY) === null;
  #key = this.#given ?? session.get(KEY) ?? local.get(KEY) ?? newKey();

  constructor(_: HTMLElement, store: Store, connection: Connection) {
    this.#connection = connection;
    store.on('hello', () => this.#introduce());
    store.on('you', ({ accepted }) => accepted || this.#beAnother());
    if (store.me.id !== '') {
      this.#introduce();
    }
  }

  /** @returns headers that identify this page in requests */
  get headers(): Record<string, string> {
    return { 'X-Crgame-Key': this.#key };
  }

  #introduce() {
    if (this.#given === null) {
      session.set(KEY, this.#key);
      if (local.get(KEY) === null) {
        local.set(KEY, this.#key);
      }
    }
    this.#connection.send({ type: 'person', key: this.#key, fresh: this.#fresh });
    // From now on a restored connection belongs to this tab.
    this.#fresh = false;
  }

  #beAnother() {
    this.#given = null;
    this.#key = newKey();
    this.#introduce();
  }
}

/** @returns the key in the address, null if there is none */
function givenKey(): string | null {
  const key = new URLSearchParams(window.location.search).get('key') ?? '';
  return isKey(key) ? key : null;
}
