// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The panel of past runs: pictures, with replay, comparison, download and deletion. */

import { element, setAttribute, setText } from '../dom.js';
import { confirm } from '../panels/confirm.js';
import { clockTime, errorText, oneLine, plural } from '../panels/format.js';
import { icon } from '../panels/icons.js';
import * as api from './run_api.js';
import { scoreBlock } from './score.js';

import type { PastRun } from '../api_messages.js';
import type { Store } from '../store.js';

const MOST_COMPARED = 6;
const MEGA = 1e6;

/** The list; one per page. */
export class RunList {
  #store;
  #root;
  #list = element('ul', { class: 'runs' });
  #error = element('p', { class: 'field-error', role: 'alert' });
  #hint = element('p', { class: 'hint', role: 'status' });
  #compare = element('button', { type: 'button', class: 'wide', disabled: true,
    on: { click: () => this.#open(api.comparisonAddress([...this.#chosen])) } },
  'Compare the chosen runs');
  #chosen = new Set<string>();
  // By id, as shown, so that pictures are not requested again.
  #items = new Map<string, { text: string; node: HTMLElement }>();

  constructor(root: HTMLElement, store: Store) {
    this.#store = store;
    this.#root = root;
    root.append(element('div', { class: 'stack' }, this.#compare, this.#error, this.#hint,
      this.#list));
    new MutationObserver(() => this.#seen()).observe(root, { attributeFilter: ['hidden'] });
    store.on(['files', 'hello'], () => this.#seen());
    this.#seen();
  }

  #seen() {
    if (!this.#root.hidden && this.#store.mode === 'live') {
      this.refresh();
    } else if (this.#store.mode === 'replay') {
      setText(this.#hint, 'A recording is being shown: its cockpit has the list of runs.');
      setAttribute(this.#compare, 'hidden', true);
    }
  }

  /**
   * Fetch the list of runs from the server.
   * @param refusal of an order, to be told meanwhile and with the new list
   */
  async refresh(refusal = '') {
    if (refusal) {
      setText(this.#error, refusal);
    }
    try {
      const runs = await api.fetchRuns();
      setText(this.#error, refusal);
      this.#show(runs);
    } catch (error) {
      setText(this.#error, errorText(error));
    }
  }

  #show(runs: PastRun[]) {
    const known = new Map(runs.map((run) => [run.id, run]));
    for (const id of [...this.#chosen].filter((each) => !known.get(each)?.closed)) {
      this.#chosen.delete(id);
    }
    this.#items = new Map(runs.map((run) => {
      const text = JSON.stringify(run);
      const shown = this.#items.get(run.id);
      return [run.id, shown?.text === text ? shown : { text, node: this.#item(run) }];
    }));
    const nodes = [...this.#items.values()].map(({ node }) => node);
    if (nodes.some((node, i) => this.#list.children[i] !== node)
        || nodes.length !== this.#list.children.length) {
      this.#list.replaceChildren(...nodes);
    }
    setText(this.#hint, runs.length === 0 ? 'Nothing has been recorded yet.' : '');
    this.#count();
  }

  #count() {
    const chosen = this.#chosen.size;
    this.#compare.disabled = chosen < 2 || chosen > MOST_COMPARED;
    setText(this.#compare, chosen < 2 ? 'Choose runs to compare them'
      : chosen > MOST_COMPARED ? `At most ${MOST_COMPARED} can be compared`
        : `Compare ${chosen} runs`);
  }

  #item(run: PastRun) {
    const score = element('div', { class: 'run-score' });
    const title = run.title || run.scenario || run.name;
    return element('li', { class: 'card run', 'data-run': run.id, 'data-name': run.name },
      run.closed ? element('img', { class: 'run-picture', src: api.pictureAddress(run.id),
        loading: 'lazy', alt: `The end of ${run.name} from above, with the ways driven` }) : null,
      element('div', { class: 'run-head' },
        run.closed ? this.#choice(run) : null,
        element('h3', {}, element('bdi', { text: title }))),
      element('p', { class: 'dim', text: facts(run) }),
      element('div', { class: 'run-buttons' },
        ...(run.closed ? this.#links(run, score) : []),
        element('button', { type: 'button', 'data-action': 'delete', disabled: !run.finished,
          title: run.finished ? 'Delete its files'
            : 'It is being recorded, or its files are being written',
          'aria-label': `Delete ${run.name}`, on: { click: () => this.#delete(run) } },
        icon('bin'))),
      run.closed ? fileMenu(run) : null, score);
  }

  #choice(run: PastRun) {
    return element('input', { type: 'checkbox', 'aria-label': `Compare ${run.name}`,
      checked: this.#chosen.has(run.id), on: { change: (event) => {
        const box = event.currentTarget as HTMLInputElement;
        this.#chosen[box.checked ? 'add' : 'delete'](run.id);
        this.#count();
      } } });
  }

  #links(run: PastRun, score: HTMLElement) {
    const report = run.files.find(({ name }) => name === 'report.html');
    return [
      button('replay', 'Replay', () => this.#open(api.replayAddress(run.id))),
      report === undefined ? null
        : button('report', 'Report', () => this.#open(api.fileAddress(run.id, report.name))),
      button('score', 'Score', () => this.#score(run, score)),
    ].filter((item) => item !== null);
  }

  #open(address: string) {
    window.open(address, '_blank', 'noopener');
  }

  async #score(run: PastRun, root: HTMLElement) {
    if (root.firstElementChild) {
      root.replaceChildren();
      return;
    }
    root.replaceChildren(scoreBlock({ state: 'waiting' }, null));
    try {
      const score = await api.fetchScore(run.id);
      root.replaceChildren(scoreBlock({ state: 'told', score }, null));
    } catch (error) {
      root.replaceChildren(scoreBlock({ state: 'none', why: errorText(error) }, null));
    }
  }

  async #delete(run: PastRun) {
    const megabytes = (run.bytes / MEGA).toFixed(1);
    if (!await confirm(`Delete ${run.name}?`, `${plural(run.files.length, 'file')}, ${megabytes} `
      + 'MB: recording, scenario and reports. They cannot be brought back.', 'Delete')) {
      return;
    }
    let refusal = '';
    try {
      await api.deleteRun(run.id);
    } catch (error) {
      refusal = errorText(error);
    }
    await this.refresh(refusal);
  }
}

function facts({ name, began_ms, duration_s, contacts, closed, bytes }: PastRun) {
  return [
    began_ms === null ? '' : new Date(began_ms).toLocaleString(),
    closed ? '' : 'being recorded', duration_s === null ? '' : clockTime(duration_s),
    contacts === null ? '' : plural(contacts, 'contact'), `${(bytes / MEGA).toFixed(1)} MB`,
    oneLine(name),
  ].filter(Boolean).join(' · ');
}

function fileMenu({ id, files }: PastRun) {
  return element('details', { class: 'run-files' }, element('summary', { text: 'Download' }),
    element('ul', {},
      element('li', {}, element('a', { href: api.zipAddress(id), download: true,
        text: 'Everything as ZIP' })),
      ...files.map(({ name, bytes }) => element('li', {},
        element('a', { href: api.fileAddress(id, name), download: true, text: name }),
        element('span', { class: 'dim', text: ` ${(bytes / MEGA).toFixed(2)} MB` })))));
}

function button(action: string, text: string, act: () => void) {
  return element('button', { type: 'button', 'data-action': action, text, on: { click: act } });
}
