// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The choice of drivers and planners in the chosen scenario. */

import { element, setText } from '../dom.js';
import { baseName } from './event_words.js';
import { PlannerOptions } from './planner_options.js';
import { fetchPlannerOptions } from './scenario_api.js';

import type { Preview } from '../api_messages.js';

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
  root;

  constructor() {
    this.root = element('div', { class: 'who' });
  }

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
      const more = new PlannerOptions(select, options ?? {}, fetchPlannerOptions);
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
