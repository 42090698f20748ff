// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The scenarios to choose from, by folder, with a filter. */

import { element } from '../dom.js';
import { oneLine } from './format.js';
import { icon } from './icons.js';

import type { Entry, Offer } from '../api_messages.js';

const KINDS = { game: 'game', scenario: 'CommonRoad', upload: 'uploaded' };

const isGame = (entry: Entry) => entry.kind === 'game';

/** Sort games before bare scenarios, because games are made to be driven. */
function gamesFirst(entries: Entry[]) {
  return [...entries.filter(isGame), ...entries.filter((entry) => !isGame(entry))];
}

/** A list of buttons of which one is chosen. */
export class ScenarioList {
  #chosen;
  #unwanted;
  #list = element('div', { class: 'scenario-list', role: 'radiogroup', 'aria-label': 'Scenario' });
  #nothing = element('p', { class: 'hint', hidden: true });
  #filter = element('input', {
    type: 'search', placeholder: 'Filter by name', 'aria-label': 'Filter the scenarios',
    on: { input: () => this.#sift() },
  });
  #entries = new Map<string, {
    entry: Entry; button: HTMLButtonElement; item: HTMLElement; words: string }>();
  root = element('div', { class: 'scenario-choice' }, this.#filter, this.#list, this.#nothing);

  /** `chosen` called with the chosen entry; `unwanted` called with the upload to delete. */
  constructor(chosen: (entry: Entry) => void, unwanted: (entry: Entry) => void) {
    this.#chosen = chosen;
    this.#unwanted = unwanted;
  }

  /** `folders` of /api/scenarios; `chosen`: id of the entry that is marked, empty for none. */
  show(folders: Offer['folders'], chosen: string) {
    this.#entries.clear();
    this.#list.replaceChildren(...folders.filter((folder) => folder.entries.length > 0).map(
      (folder) => element('div', { class: 'scenario-folder' },
        element('h3', { text: folder.name }),
        ...gamesFirst(folder.entries).map((entry) => this.#item(entry)))));
    this.mark(chosen);
    this.#sift();
  }

  /** @param id of the entry to mark as chosen */
  mark(id: string) {
    for (const [other, { button }] of this.#entries) {
      button.setAttribute('aria-checked', String(other === id));
    }
    this.#entries.get(id)?.button.scrollIntoView({ block: 'nearest' });
  }

  /** The games, in the order of the list. */
  get games() {
    return [...this.#entries.values()].map(({ entry }) => entry).filter(isGame);
  }

  #item(entry: Entry) {
    const title = oneLine(entry.title || entry.name);
    const button = element('button', {
      type: 'button', role: 'radio', class: 'scenario', 'data-id': entry.id,
      title: oneLine(entry.name),
      on: { click: () => this.#chosen(entry) },
    }, icon('check'),
    element('span', { class: 'scenario-title', text: title }));
    const item = entry.kind !== 'upload' ? button : element('div', { class: 'upload' }, button,
      element('button', { type: 'button', class: 'icon-button', title: 'Delete this upload',
        'aria-label': `Delete ${title}`, 'data-action': 'delete', 'data-id': entry.id,
        on: { click: () => this.#unwanted(entry) } }, icon('bin')));
    this.#entries.set(entry.id, {
      entry, button, item, words: `${title} ${entry.name} ${KINDS[entry.kind]}`.toLowerCase(),
    });
    return item;
  }

  #sift() {
    const wanted = this.#filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    let found = 0;
    for (const { item, words } of this.#entries.values()) {
      item.hidden = !wanted.every((word) => words.includes(word));
      found += item.hidden ? 0 : 1;
    }
    for (const folder of this.#list.children as Iterable<HTMLElement>) {
      folder.hidden = !folder.querySelector(':scope > :is(button, div):not([hidden])');
    }
    this.#nothing.hidden = found > 0;
    this.#nothing.textContent = this.#entries.size === 0
      ? 'No scenario in the configured folders.' : `Nothing is called "${this.#filter.value}".`;
  }
}
