// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The options of the planner that is chosen for an AV, as the planner declares them. */

import { element, setText } from '../dom.js';
import { errorText, oneLine } from './format.js';

import type { PlannerOption } from '../api_messages.js';

/** Fields for the options, which are asked for when they are opened. */
export class PlannerOptions {
  #select;
  #own;
  #present;
  #ask;
  #fields = element('div', { class: 'stack' });
  #hint = element('p', { class: 'hint' });
  /** Of the chosen planner; null until they are known. */
  #inputs: Map<string, HTMLInputElement> | null = null;
  /** The planner that was asked about last. */
  #asked = '';
  root;

  /**
   * @param select the choice of the planner
   * @param own the game's options for its own planner, as typed
   * @param ask for the options of a planner
   */
  constructor(select: HTMLSelectElement, own: Record<string, string>,
    ask: (planner: string) => Promise<PlannerOption[]>) {
    this.#select = select;
    this.#own = own;
    this.#present = select.value;
    this.#ask = ask;
    this.root = element('details', { class: 'planner-options' },
      element('summary', { text: 'Options' }), this.#hint, this.#fields);
    this.root.addEventListener('toggle', () => this.#open());
    select.addEventListener('change', () => this.#forget());
  }

  /** Return what was typed, by option; null if the options have not been looked at. */
  get values() {
    return this.#inputs && Object.fromEntries([...this.#inputs].map(
      ([name, input]) => [name, input.value.trim()]).filter(([, text]) => text !== ''));
  }

  #forget() {
    this.root.open = false;
    this.#inputs = null;
    this.#asked = '';
    this.#fields.replaceChildren();
  }

  async #open() {
    const planner = this.#select.value;
    if (!this.root.open || this.#asked === planner) {
      return;
    }
    this.#asked = planner;
    setText(this.#hint, 'Asking the planner …');
    try {
      const options = await this.#ask(planner);
      if (this.#asked === planner) {
        setText(this.#hint, options.length ? '' : 'It has none.');
        this.#show(options, planner === this.#present ? this.#own : {});
      }
    } catch (error) {
      if (this.#asked === planner) {
        this.#asked = '';
        setText(this.#hint, errorText(error));
      }
    }
  }

  #show(options: PlannerOption[], present: Record<string, string>) {
    this.#inputs = new Map(options.map(({ name, default: usual }) => [name, element('input', {
      type: 'text', autocomplete: 'off', placeholder: usual || 'required',
      value: Object.hasOwn(present, name) ? present[name] : '' })]));
    this.#fields.replaceChildren(...options.map(({ name, meaning, wanted }) => element(
      'label', { class: 'planner-option' }, element('span', { text: name }),
      this.#inputs?.get(name) ?? null,
      element('span', { class: 'hint', text: oneLine(`${meaning}; ${wanted}`) }))));
  }
}
