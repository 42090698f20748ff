// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The panel that chooses, previews and loads a scenario (FastSim's scenario loading area). */

import { element, setAttribute, setText } from '../dom.js';
import { reasonAgainst } from '../rights.js';
import { confirm } from './confirm.js';
import { errorText, oneLine, plural } from './format.js';
import { icon } from './icons.js';
import { deleteUpload, fetchPreview, fetchScenarios, load, upload } from './scenario_api.js';
import { ScenarioForm } from './scenario_form.js';
import { ScenarioList } from './scenario_list.js';
import { ScenarioPreview } from './scenario_preview.js';

import type { Entry, Offer, Preview } from '../api_messages.js';
import type { Connection } from '../connection.js';
import type { Store } from '../store.js';

// A larger file is not sent, because the server would refuse it [bytes].
const LARGEST_FILE = 64 * 1024 * 1024;
// Longest wait for the loaded run to begin [ms].
const BEGINS_WITHIN_MS = 60000;
// What is said of a preview that takes longer: code for traffic is compiled when first needed.
const SLOW_MS = 6000;
const COMPILING = 'Reading the scenario … Traffic needs a minute when it is first used.';

/** The panel's parts and choices. */
class ScenarioPanel {
  #store;
  #connection;
  #offered: Offer = { folders: [], planners: [], drivers: [] };
  #chosen = '';
  // The entry that was started last here.
  #begun = '';
  #abort: AbortController | null = null;
  #list = new ScenarioList((entry) => this.choose(entry.id),
    (entry) => this.#delete(entry));
  #form = new ScenarioForm();
  #busy = busyBar();
  #canvas = element('canvas', { class: 'preview', 'aria-label': 'Preview of the scenario' });
  #drawing = new ScenarioPreview(this.#canvas);
  #facts = element('p', { class: 'dim' });
  #name = element('h3', {});
  #notices = element('ul', { class: 'notice-list' });
  #errors = {
    list: fieldError(), upload: fieldError(), preview: fieldError(), start: fieldError(),
  };
  #start = element('button', {
    type: 'button', class: 'primary wide', disabled: true, on: { click: () => this.start() },
  }, icon('go'), 'Start this scenario');
  #warning = element('p', {
    class: 'hint', hidden: true,
    text: 'The present run ends for everybody. Its recording is kept.',
  });
  #card;
  #dropZone;

  constructor(root: HTMLElement, store: Store, connection: Connection) {
    this.#store = store;
    this.#connection = connection;
    const file = element('input', {
      type: 'file', accept: '.xml,text/xml,application/xml', class: 'unseen', tabindex: '-1',
      'aria-label': 'CommonRoad file', on: {
        change: () => {
          this.upload([...file.files ?? []]);
          file.value = '';
        },
      },
    });
    this.#dropZone = element('div', { class: 'drop-zone' }, icon('upload'),
      element('span', { text: 'Drop a CommonRoad file, or' }),
      element('button', {
        type: 'button', text: 'Choose …', on: { click: () => file.click() },
      }), file);
    this.#card = element('div', { class: 'card preview-card', hidden: true }, this.#canvas,
      this.#name, this.#facts, this.#notices, this.#form.root);
    root.append(this.#list.root, this.#errors.list,
      this.#dropZone, this.#errors.upload, this.#card, this.#errors.preview,
      element('div', { class: 'start-area' }, this.#busy.root, this.#warning,
        this.#errors.start, this.#start));
    store.on('status', () => this.#warn());
    acceptDrops(this.#dropZone, (files) => {
      if (store.mode !== 'live' || !store.rights.directs) {
        return;
      }
      const tab: HTMLElement | null = document.querySelector('#tab-scenario');
      tab?.click();
      this.upload(files);
    });
  }

  /** Fetch the list of scenarios from the server. */
  async refresh() {
    try {
      this.#offered = await fetchScenarios();
      setText(this.#errors.list, '');
    } catch (error) {
      setText(this.#errors.list, errorText(error));
    }
    this.#list.show(this.#offered.folders, this.#chosen);
  }

  /** Preview an entry, so that it can be started. */
  async choose(id: string) {
    this.#abort?.abort();
    const abort = new AbortController();
    this.#abort = abort;
    this.#chosen = id;
    this.#clearErrors();
    this.#list.mark(id);
    this.#start.disabled = true;
    this.#busy.describe('Reading the scenario …');
    const slow = setTimeout(() => this.#busy.describe(COMPILING), SLOW_MS);
    try {
      const preview = await fetchPreview(id, abort.signal);
      this.#show(preview);
    } catch (error) {
      if (abort.signal.aborted) {
        return;
      }
      this.#card.hidden = true;
      setText(this.#errors.preview, errorText(error));
    } finally {
      clearTimeout(slow);
    }
    this.#busy.end();
  }

  /** Upload a chosen or dropped file. */
  async upload(files: File[]) {
    this.#clearErrors();
    const [file] = files;
    const wrong = wrongFiles(files);
    if (wrong) {
      setText(this.#errors.upload, wrong);
      return;
    }
    this.#busy.describe(`Sending ${file.name} …`);
    try {
      const id = await upload(file);
      await this.refresh();
      await this.choose(id);
    } catch (error) {
      setText(this.#errors.upload, errorText(error));
    }
    this.#busy.end();
  }

  /** Load the chosen scenario and wait until its run begins. */
  async start() {
    this.#clearErrors();
    this.#start.disabled = true;
    this.#busy.describe('Loading …');
    const begun = this.#nextRun();
    try {
      const text = await load({ id: this.#chosen, ...this.#form.choices });
      this.#busy.describe(text ? `${text.replace(/[.…\s]+$/, '')} …` : 'Loading …');
      this.#begun = this.#chosen;
      await begun.promise;
      if (this.#store.status?.run === 'paused' && !waitsForSeveral(this.#store)) {
        await this.#connection.request({ type: 'control', action: 'start' });
      }
    } catch (error) {
      begun.cancel();
      if (!this.#form.blame(errorText(error))) {
        setText(this.#errors.start, errorText(error));
      }
    }
    this.#busy.end();
    this.#start.disabled = false;
  }

  /** @param entry an upload */
  async #delete(entry: Entry) {
    this.#clearErrors();
    if (!await confirm(`Delete the upload ${oneLine(entry.title)}?`,
      'It can be uploaded again. Recordings of it keep the map.', 'Delete')) {
      return;
    }
    try {
      await deleteUpload(entry.id);
      if (this.#chosen === entry.id) {
        this.#chosen = '';
        this.#card.hidden = true;
        this.#start.disabled = true;
      }
      await this.refresh();
    } catch (error) {
      setText(this.#errors.list, errorText(error));
    }
  }

  /** Start the game after the present one in the list, the first one after the last. */
  async startNext() {
    await this.refresh();
    const games = this.#list.games;
    const title = this.#store.scene?.title;
    const at = games.findIndex((entry) => entry.id === this.#begun);
    const present = at >= 0 ? at : games.findIndex((entry) => entry.title === title);
    if (games.length === 0) {
      this.#store.receive({ type: 'notice', level: 'warn', text: 'There is no other game.' });
      return;
    }
    await this.choose(games[(present + 1) % games.length].id);
    if (!this.#start.disabled) {
      await this.start();
    }
    const refusal = Object.values(this.#errors).map((node) => node.textContent).find(Boolean);
    if (refusal) {
      this.#store.receive({ type: 'notice', level: 'error', text: refusal });
    }
  }

  /** Warn in advance whose run will end. */
  #warn() {
    const run = this.#store.status?.run;
    const goesOn = run === 'running' || run === 'paused';
    setAttribute(this.#warning, 'hidden', this.#start.disabled || !goesOn);
  }

  /** Resolves when a run of a new epoch is no longer waiting for its planners. */
  #nextRun() {
    const before = this.#store.scene?.time?.epoch ?? this.#store.epoch;
    const ends: (() => void)[] = [];
    const cancel = () => ends.splice(0).forEach((end) => end());
    const promise = new Promise<void>((resolve, reject) => {
      const timer = setTimeout(() => {
        cancel();
        reject(new Error('The run has not begun within a minute; the timing panel and the '
          + 'terminal may tell why.'));
      }, BEGINS_WITHIN_MS);
      const look = () => {
        const epoch = this.#store.scene?.time?.epoch ?? -1;
        const run = this.#store.status?.run;
        if (epoch > before && this.#store.status?.epoch === epoch) {
          if (run === 'waiting') {
            this.#busy.describe('Waiting for the planners …');
          } else {
            cancel();
            resolve();
          }
        }
      };
      ends.push(() => clearTimeout(timer), this.#store.on('status', look));
    });
    // When loading fails, it is no longer awaited.
    promise.catch(() => {});
    return { promise, cancel };
  }

  #show(preview: Preview) {
    this.#card.hidden = false;
    const { scene } = preview;
    setText(this.#name, oneLine(scene.title || scene.benchmark_id));
    setText(this.#facts, [
      scene.title === scene.benchmark_id ? '' : scene.benchmark_id,
      plural(scene.lanelets.length, 'lanelet'), plural(preview.humans.length, 'human'),
      plural(preview.avs.length, 'AV'), plural(scene.objects.length, 'other object'),
    ].filter(Boolean).join(' · '));
    this.#notices.replaceChildren(...(preview.notices ?? []).map(
      (text) => element('li', {}, icon('info'), element('span', { text: oneLine(text) }))));
    this.#form.show(preview, this.#offered.drivers ?? [], this.#offered.planners ?? []);
    this.#drawing.show(preview);
    this.#start.disabled = false;
  }

  #clearErrors() {
    for (const error of Object.values(this.#errors)) {
      setText(error, '');
    }
    this.#form.blame('');
  }
}

/** Return whether several drivers have to report that they are ready. */
function waitsForSeveral(store: Store) {
  return Object.values(store.seats).filter(({ driver }) => driver === 'cockpit').length > 1;
}

function fieldError() {
  return element('p', { class: 'field-error', role: 'alert' });
}

/**
 * Accept files that are dropped on the page, so that the browser does not open them.
 * @param zone gets data-over while a drop would be accepted
 * @param taken gets the files
 */
function acceptDrops(zone: HTMLElement, taken: (files: File[]) => void) {
  const hasFiles = (event: DragEvent) => [...event.dataTransfer?.types ?? []].includes('Files');
  const over = (event: DragEvent) => {
    if (hasFiles(event)) {
      event.preventDefault();
      if (event.dataTransfer !== null) {
        event.dataTransfer.dropEffect = 'copy';
      }
      zone.dataset.over = 'yes';
    }
  };
  const leave = (event: DragEvent) => {
    // Every element fires dragleave; only leaving the page has no related target.
    if (event.relatedTarget === null) {
      delete zone.dataset.over;
    }
  };
  window.addEventListener('dragenter', over);
  window.addEventListener('dragover', over);
  window.addEventListener('dragleave', leave);
  window.addEventListener('drop', (event) => {
    delete zone.dataset.over;
    if (hasFiles(event)) {
      event.preventDefault();
      taken([...event.dataTransfer?.files ?? []]);
    }
  });
}

function wrongFiles(files: File[]) {
  if (files.length !== 1) {
    return files.length === 0 ? 'That is no file.' : 'Drop one file at a time.';
  }
  const [file] = files;
  if (!file.name.toLowerCase().endsWith('.xml')) {
    return `${file.name} is no CommonRoad file: its name does not end in .xml.`;
  }
  return file.size > LARGEST_FILE ? `${file.name} is larger than 64 MB.` : '';
}

/** Create the panel, which fetches its list when it is first shown. */
export function createScenario(root: HTMLElement, store: Store,
  connection: Connection): ScenarioPanel {
  const replay = element('p', {
    class: 'hint', hidden: true,
  });
  const body = element('div', { class: 'stack' });
  root.append(replay, body);
  const panel = new ScenarioPanel(body, store, connection);
  const seen = () => {
    const refused = store.mode === 'replay' ? 'A recording is being shown: nothing can be loaded.'
      : reasonAgainst(store, 'direct', 'choose what is run');
    setText(replay, refused);
    replay.hidden = refused === '';
    body.hidden = refused !== '';
    if (!root.hidden && refused === '') {
      panel.refresh();
    }
  };
  new MutationObserver(seen).observe(root, { attributeFilter: ['hidden'] });
  store.on(['hello', 'you'], seen);
  seen();
  return panel;
}

const SHOWN_AFTER_MS = 300;
const COUNTED_AFTER_S = 2;

/** Make a moving bar for a long task, with a text and the elapsed seconds, hidden until begun. */
function busyBar() {
  const text = element('span', {});
  const root = element('div', { class: 'busy', role: 'status', hidden: true },
    element('div', { class: 'busy-bar', 'aria-hidden': 'true' }), text);
  let [timer, since, words] = [0, 0, ''];
  const show = () => {
    const passed_ms = performance.now() - since;
    root.hidden = passed_ms < SHOWN_AFTER_MS;
    const seconds = Math.floor(passed_ms / 1e3);
    setText(text, seconds >= COUNTED_AFTER_S ? `${words} ${seconds} s` : words);
  };
  return {
    root,
    /** Start, or change the words of what is done; the seconds count from the first call. */
    describe(what: string) {
      words = what;
      if (timer === 0) {
        since = performance.now();
        timer = setInterval(show, 100);
      }
      show();
    },
    end() {
      clearInterval(timer);
      timer = 0;
      root.hidden = true;
    },
  };
}
