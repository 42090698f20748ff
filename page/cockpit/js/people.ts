// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The people at this cockpit: roles, delays, and links that admit others. */

import { element, setAttribute, setText } from './dom.js';
import { errorText, oneLine } from './panels/format.js';
import { session } from './panels/memory.js';
import { post } from './panels/scenario_api.js';
import { tellRefusal } from './rights.js';

import type { Connection } from './connection.js';
import type { DeviceDelay, Present, RoleName } from './messages.js';
import type { Store } from './store.js';

const ROLES: [role: string, text: string][] = [['all', 'Director and driver'],
  ['direct', 'Director'], ['drive', 'Driver'], ['watch', 'Spectator']];

const ROLE = 'crgame.role';

/** The section of the Drive panel. */
export class People {
  #store;
  #connection;
  #list = element('ul', { class: 'people' });
  #role = element('select', { id: 'my-role', on: { change: () => this.#choose() } });
  #roleRow = element('p', { class: 'people-role' },
    element('label', { for: 'my-role', text: 'You take part as' }), this.#role);
  #whom = element('select', { 'aria-label': 'Role that the link gives' });
  #link = element('input', { type: 'text', readonly: true, hidden: true,
    'aria-label': 'The link', on: { focus: () => this.#link.select() } });
  #error = element('p', { class: 'field-error', role: 'alert' });
  #invite = element('form', { class: 'people-invite', hidden: true,
    on: { submit: (event: Event) => this.#makeLink(event) } },
  this.#whom, element('button', { type: 'submit', class: 'drive-button', text: 'Make a link',
    title: 'A link that lets one browser in' }), this.#link, this.#error);
  #shown = '';
  // A role that this page may not have is asked for once.
  #refused = '';

  constructor(root: HTMLElement, store: Store, connection: Connection) {
    this.#store = store;
    this.#connection = connection;
    const section = element('section', { class: 'drive-section',
      'aria-labelledby': 'people-title' },
    element('h2', { id: 'people-title', text: 'People' }), this.#roleRow, this.#list,
    this.#invite);
    root.append(section);
    store.on(['hello', 'you', 'people', 'scene'], () => {
      setAttribute(section, 'hidden', store.mode === 'replay');
      this.#show();
    });
    store.on('hello', () => this.#chooseAgain());
    this.#chooseAgain();
    this.#show();
  }

  #show() {
    const { people, devices, rights, scene } = this.#store;
    this.#list.replaceChildren(...people.map((person) => this.#row(person)),
      ...devices.map(deviceRow));
    const humans = (scene?.vehicles ?? []).filter(({ role }) => role === 'human');
    const shown = JSON.stringify([rights, humans.map(({ id }) => id)]);
    if (shown === this.#shown) {
      return;
    }
    this.#shown = shown;
    const { may_direct, may_drive, directs, drives } = rights;
    const now = directs ? (drives ? 'all' : 'direct') : drives ? 'drive' : 'watch';
    const possible = ROLES.filter(([role]) => (may_direct || !['all', 'direct'].includes(role))
      && (may_drive || !['all', 'drive'].includes(role)));
    this.#role.replaceChildren(...possible.map(([role, text]) => element('option',
      { value: role, text, selected: role === now })));
    setAttribute(this.#roleRow, 'hidden', possible.length < 2);
    // Links exist only if the cockpit is open to the network, which is over TLS.
    setAttribute(this.#invite, 'hidden', !directs || window.location.protocol !== 'https:');
    this.#whom.replaceChildren(
      ...humans.map(({ id }) => element('option', { value: `drive ${id}`, text: `drive ${id}` })),
      element('option', { value: 'watch', text: 'watch' }),
      element('option', { value: 'direct', text: 'direct' }));
  }

  #row({ client, name, role, seat, round_trip_ms, input_delay_ms }: Present) {
    const me = client === this.#store.me.id ? ' (you)' : '';
    return element('li', { 'data-client': client },
      element('strong', { text: `${oneLine(name)}${me}` }),
      element('span', { text: seat === null ? role : `${role} in ${seat}` }),
      delays(['round trip', round_trip_ms, 0], ['input latency', input_delay_ms, 0]));
  }

  #choose() {
    // A select that keeps the focus would take the driving keys.
    this.#role.blur();
    session.set(ROLE, this.#role.value);
    this.#requestRole(this.#role.value as RoleName);
  }

  /** Restore the chosen role: a new connection begins with all granted rights. */
  #chooseAgain() {
    const role = session.get(ROLE)
      ?? new URLSearchParams(window.location.search).get('role');
    if (this.#store.me.id !== '' && this.#store.mode === 'live' && role !== this.#refused
        && ROLES.some(([known]) => known === role)) {
      this.#requestRole(role as RoleName);
    }
  }

  async #requestRole(role: RoleName) {
    if (!await tellRefusal(this.#store, this.#connection.request({ type: 'role', role }))) {
      this.#refused = role;
    }
  }

  async #makeLink(event: Event) {
    event.preventDefault();
    const [role, seat = ''] = this.#whom.value.split(' ');
    let [link, refusal] = ['', ''];
    try {
      ({ link } = await post<{ link: string }>('/api/invite', { role, seat }));
    } catch (error) {
      refusal = errorText(error);
    }
    setText(this.#error, refusal);
    setAttribute(this.#link, 'hidden', link === '');
    this.#link.value = link;
    this.#link.select();
  }
}

function deviceRow({ seat, device, command_ms, input_delay_ms }: DeviceDelay) {
  return element('li', { 'data-device': seat }, element('strong', { text: oneLine(device) }),
    element('span', { text: `drives ${seat} at the machine of the game` }),
    delays(['command latency', command_ms, 1], ['input latency', input_delay_ms, 0]));
}

/** Make the note with the delays that are known. */
function delays(...all: [name: string, delay_ms: number | null, digits: number][]) {
  return element('span', { class: 'drive-note', text: all.flatMap(([name, delay_ms, digits]) => (
    delay_ms === null ? [] : [`${name} ${delay_ms.toFixed(digits)} ms`])).join(', ') });
}
