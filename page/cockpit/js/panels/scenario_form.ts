// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The choice of drivers, planners and planners' options in the chosen scenario. */

import { element, setText } from '../dom.js';
import { baseName } from './event_words.js';
import { errorText, oneLine } from './format.js';
import { fetchPlannerOptions } from './scenario_api.js';

import type { PlannerOption, Preview } from '../api_messages.js';

const DRIVERS: Record<string, string> = {
  auto: "this machine's wheel, gamepad or keyboard", idle: 'no driver', cockpit: 'a cockpit page',
  evdev: 'a wheel or gamepad at this machine', joy: 'messages on the joy topic',
};

/** One choice for each human-driven and each autonomous vehicle. */
export class ScenarioForm {
  #rows = new Map<string, { select: HTMLSelectElement; error: HTMLElement }>();
  #options = new Map<string, PlannerOptions>();
  #humans: string[] = [];
  #avs: string[] = [];
  root = element('div', { class: 'who' });

  /**
   * @param preview answer of /api/preview
   * @param drivers that can be chosen
   * @param planners that can be chosen
   */
  show(preview: Preview, drivers: string[], planners: string[]) {
    this.#rows.clear();
    this.#options.clear();
    this.#humans = preview.humans.map((human) => human.id);
    this.#avs = preview.avs.map((av) => av.id);
    const nodes: HTMLElement[] = [];
    for (const { id, driver } of preview.humans) {
      nodes.push(this.#row(id, 'human', 'driven by', driver, drivers, driverWords));
    }
    for (const { id, planner, planning_problem: problem, options } of preview.avs) {
      const row = this.#row(id, 'av', 'planned by', planner, planners, baseName);
      if (problem !== null && problem !== undefined) {
        row.title = `planning problem ${problem}`;
      }
      const select = this.#rows.get(id)?.select as HTMLSelectElement;
      const more = new PlannerOptions(select, options ?? {});
      this.#options.set(id, more);
      row.append(more.root);
      nodes.push(row);
    }
    this.root.replaceChildren(...nodes);
  }

  /** Return the choices: humans [{id, driver}], avs [{id, planner, options}]. */
  get choices() {
    const value = (id: string) => this.#rows.get(id)?.select.value ?? '';
    return {
      humans: this.#humans.map((id) => ({ id, driver: value(id) })),
      avs: this.#avs.map((id) => {
        const options = this.#options.get(id)?.values;
        return { id, planner: value(id), ...(options ? { options } : {}) };
      }),
    };
  }

  /**
   * Show an error beside the vehicle that it names.
   * @param text the error; empty removes all
   * @returns false if it names no vehicle here
   */
  blame(text: string): boolean {
    let found = false;
    for (const [id, { select, error }] of this.#rows) {
      const named = text.split(/\W+/).includes(id)
        || (select.value !== '' && text.includes(`"${select.value}"`));
      setText(error, named && !found ? text : '');
      select.setAttribute('aria-invalid', String(named && !found));
      found ||= named;
    }
    return found;
  }

  #row(id: string, role: string, label: string, present: string, known: string[],
    words: (value: string) => string) {
    const all = [...new Set([present, ...known].filter(Boolean))];
    const select = element('select', { 'aria-label': `${id} is ${label}` },
      ...all.map((value) => element('option', {
        value, selected: value === present, text: words(value),
      })));
    const error = element('p', { class: 'field-error', role: 'alert' });
    this.#rows.set(id, { select, error });
    return element('div', { class: 'who-row' },
      element('strong', { class: role, text: id }),
      element('span', { class: 'dim', text: label }), select, error);
  }
}

function driverWords(driver: string) {
  const words = Object.hasOwn(DRIVERS, driver) ? ` – ${DRIVERS[driver]}` : '';
  return baseName(driver) + words;
}

/** Fields for the options, which are asked for when they are opened. */
class PlannerOptions {
  #select;
  #own;
  #present;
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
   */
  constructor(select: HTMLSelectElement, own: Record<string, string>) {
    this.#select = select;
    this.#own = own;
    this.#present = select.value;
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
      const options = await fetchPlannerOptions(planner);
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
