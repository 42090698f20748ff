// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The field with the name that others see; kept in this browser. */

import { element } from '../dom.js';
import { recall, remember } from '../panels/memory.js';

import type { Connection } from '../connection.js';
import type { Store } from '../store.js';

const LONGEST = 40;

export function nameField(store: Store, connection: Connection): HTMLElement {
  const input = element('input', { type: 'text', id: 'my-name', maxlength: LONGEST,
    autocomplete: 'nickname', placeholder: 'Your name' });
  const greet = () => {
    if (store.me.id === '') {
      return;
    }
    const kept = recall('name');
    if (kept) {
      connection.send({ type: 'name', name: kept });
    }
    if (document.activeElement !== input) {
      input.value = kept || store.me.name;
    }
  };
  input.addEventListener('change', () => {
    const name = input.value.trim();
    if (name === '') {
      input.value = store.me.name;
      return;
    }
    store.me.name = name;
    remember('name', name);
    connection.send({ type: 'name', name });
  });
  input.addEventListener('focus', () => input.select());
  store.on('hello', greet);
  greet();
  return element('form', { class: 'name-field', on: { submit: (event) => {
    event.preventDefault();
    // Leaving the field returns the keys to the vehicle.
    input.blur();
  } } }, element('label', { for: 'my-name', text: 'You are' }), input);
}
