// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The field with the name that others see; kept in this browser. */

import { element } from '../dom.js';
import { local } from '../panels/memory.js';

import type { Connection } from '../connection.js';
import type { Store } from '../store.js';

const KEY = 'crgame.name';
const LONGEST = 40;

/** The field; `node` goes into the page. */
export class NameField {
  #store;
  #connection;
  #input = element('input', { type: 'text', id: 'my-name', maxlength: LONGEST,
    autocomplete: 'nickname', placeholder: 'Your name' });
  node;

  constructor(store: Store, connection: Connection) {
    this.#store = store;
    this.#connection = connection;
    this.node = element('form', { class: 'name-field' },
      element('label', { for: 'my-name', text: 'You are' }), this.#input);
    this.node.addEventListener('submit', (event) => {
      event.preventDefault();
      // Leaving the field returns the keys to the vehicle.
      this.#input.blur();
    });
    this.#input.addEventListener('change', () => this.#rename());
    this.#input.addEventListener('focus', () => this.#input.select());
    store.on('hello', () => this.#greet());
    this.#greet();
  }

  #greet() {
    if (this.#store.me.id === '') {
      return;
    }
    const kept = local.get(KEY);
    if (kept) {
      this.#connection.send({ type: 'name', name: kept });
    }
    if (document.activeElement !== this.#input) {
      this.#input.value = kept ?? this.#store.me.name;
    }
  }

  #rename() {
    const name = this.#input.value.trim();
    if (name === '') {
      this.#input.value = this.#store.me.name;
      return;
    }
    this.#store.me.name = name;
    local.set(KEY, name);
    this.#connection.send({ type: 'name', name });
  }
}
