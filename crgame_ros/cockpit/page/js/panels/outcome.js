// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** What stands over the world while no run goes on: how the last went, or whom the next awaits. */

import { fetchScore } from '../after/run_api.js';
import { scoreBlock } from '../after/score.js';
import { element, setAttribute } from '../dom.js';
import { errorText, oneLine } from './format.js';
import { icon } from './icons.js';
import { mishapsOf } from './mishaps.js';
import { figures, fileList, part, table, why } from './outcome_card.js';
import { TABLE_I, valueOf } from './timing.js';

/** @import { Connection } from '../connection.js' */
/** @import { Scored } from '../after/score.js' */
/** @import { Files, Reply, RunAction, RunState, Scene, Status } from '../messages.js' */
/** @import { Result } from './outcome_card.js' */
/** @import { Store } from '../store.js' */

// So long a page tells its driver of a mishap while the run goes on [ms].
const MISHAP_MS = 10000;
// In which words a figure of table I is said of a run that is over.
/** @type {Record<string, string>} */
const FINAL_NAMES = { final_error_ms: 'Lag at the end' };

/**
 * What is to be said, by phase: that the run is over, that this was closed, that a driver is
 * awaited, that everything is ready, that this page's driver has hit something or left the road.
 *
 * @typedef {{phase: 'over', connected: boolean} & Result} Over
 * @typedef {{phase: 'driver', seat: string, run: RunState, holder: string|null,
 *   holderName: string, me: string}} Awaiting
 * @typedef {{phase: 'ready'|'none', run: RunState, mine: string|null}} Ready
 * @typedef {{phase: 'mishap', run: RunState, text: string, stopped: boolean}} Mishap
 * @typedef {{phase: 'none', run?: undefined}|{phase: 'closed'}|Over|Awaiting|Ready|Mishap} Facts
 */

/** The card; one per page. */
class Outcome {
  #root;
  #store;
  #connection;
  /** @type {Files|null} */
  #files = null;
  #shown = '';
  #closedEpoch = -1;
  // Score by run, as far as it was asked for; mishaps of this run that have been told.
  /** @type {Map<string, Scored>} */
  #scores = new Map();
  #told = 0;
  #mishapTimer = 0;

  /**
   * @param {HTMLElement} root
   * @param {Store} store
   * @param {Connection} connection
   */
  constructor(root, store, connection) {
    this.#root = root;
    this.#store = store;
    this.#connection = connection;
    store.on('files', (files) => {
      this.#files = files;
      this.#show();
    });
    for (const name of /** @type {const} */ (
      ['hello', 'scene', 'seats', 'status', 'connection'])) {
      store.on(name, () => this.#show());
    }
    store.on('epoch', () => {
      this.#told = 0;
    });
    store.on('events', ({ fired }) => {
      // Back on the lane: the notice of the contact has served.
      const last = fired.at(-1);
      if (last?.by === 'driver' && last.name.endsWith(` ${window.crgame.driving?.seat}`)) {
        this.#dismiss();
      }
      this.#show();
    });
    this.#show();
  }

  /** Built anew only where something has changed: somebody may be about to press a button. */
  #show() {
    const facts = this.#facts();
    const text = JSON.stringify(facts);
    if (text === this.#shown) {
      return;
    }
    this.#shown = text;
    const { activeElement } = document;
    const focused = activeElement instanceof HTMLElement && this.#root.contains(activeElement)
      ? activeElement.dataset.action : undefined;
    setAttribute(this.#root, 'data-phase', facts.phase);
    setAttribute(this.#root, 'hidden', facts.phase === 'none');
    this.#root.replaceChildren(...this.#content(facts));
    if (focused) {
      /** @type {HTMLElement|null} */
      const again = this.#root.querySelector(`[data-action="${focused}"]`);
      again?.focus();
    }
  }

  /**
   * @param {Facts} facts
   * @returns {Node[]}
   */
  #content(facts) {
    switch (facts.phase) {
      case 'none': return [];
      case 'over': return this.#card(facts);
      case 'closed': return [this.#reopen()];
      case 'mishap': return this.#mishap(facts);
      case 'driver': return this.#bar(driverText(facts), facts);
      case 'ready': return this.#bar(facts.mine
        ? `You drive ${facts.mine}: start when you are ready.`
        : 'Everything stands at the first step.', facts);
    }
  }

  /** @returns {Facts} */
  #facts() {
    const { status, scene, mode, connected, seats, me } = this.#store;
    if (mode !== 'live' || status === null || scene === null) {
      return { phase: 'none' };
    }
    if (status.run === 'ended' && status.reason !== 'reset') {
      if (this.#closedEpoch === status.epoch) {
        return { phase: 'closed' };
      }
      return { phase: 'over', connected, ...this.#result(status, scene) };
    }
    const mine = Object.keys(seats).find((id) => seats[id].holder === me.id) ?? null;
    const mishaps = mine === null || !connected ? [] : mishapsOf(this.#store, mine);
    if (mishaps.length > this.#told) {
      const { text, touched } = mishaps[mishaps.length - 1];
      return { phase: 'mishap', run: status.run, text,
        stopped: touched && scene.contact === 'stop' };
    }
    if (!connected || status.n !== 0 || !['waiting', 'paused'].includes(status.run)) {
      return { phase: 'none' };
    }
    const [seat] = status.awaited ?? [];
    if (seat !== undefined) {
      return { phase: 'driver', seat, run: status.run, holder: seats[seat]?.holder ?? null,
        holderName: seats[seat]?.holder_name ?? '', me: me.id };
    }
    return { phase: status.run === 'paused' ? 'ready' : 'none', run: status.run, mine };
  }

  /**
   * @param {Status} status
   * @param {Scene} scene
   * @returns {Result}
   */
  #result(status, scene) {
    const files = this.#files?.epoch === status.epoch ? this.#files : null;
    const { timing } = status;
    const { seats, me } = this.#store;
    return {
      scored: this.#score(status, files),
      mine: Object.keys(seats).find((id) => seats[id].holder === me.id) ?? null,
      why: why(status), stays: Boolean(status.stays), t: status.t,
      driven: scene.vehicles.length > 0,
      contacts: (status.contacts ?? []).map((item) => ({ ...item, part: part(item, files) })),
      departures: status.departures ?? [],
      planners: scene.vehicles.filter(({ role }) => role === 'autonomous').map(({ id }) => ({
        id, name: status.planners[id]?.planner || scene.planners?.[id] || '',
        accepted: status.planners[id]?.accepted ?? 0, refused: status.planners[id]?.refused ?? 0,
        fallbacks: status.planners[id]?.fallbacks ?? 0 })),
      figures: timing ? TABLE_I.map(([key, name, explanation, format]) => [
        FINAL_NAMES[key] ?? name, format(valueOf(timing, key)), explanation]) : [],
      recording: status.recording, files,
    };
  }

  /**
   * Give the score of the run, once its recording is closed and the server has told it.
   *
   * @param {Status} status
   * @param {Files|null} files
   * @returns {Scored}
   */
  #score({ recording }, files) {
    if (files === null || recording.state === 'recording') {
      return recording.state === 'none' ? { state: 'none', why: 'nothing was recorded' }
        : { state: 'waiting' };
    }
    const known = this.#scores.get(files.run);
    if (known !== undefined) {
      return known;
    }
    this.#scores.set(files.run, { state: 'waiting' });
    fetchScore(files.run).then(
      (score) => this.#scores.set(files.run, { state: 'told', score }),
      (error) => this.#scores.set(files.run, { state: 'none', why: errorText(error) }),
    ).then(() => this.#show());
    return { state: 'waiting' };
  }

  /**
   * @param {Mishap} facts
   * @returns {Node[]}
   */
  #mishap({ run, text, stopped }) {
    clearTimeout(this.#mishapTimer);
    if (run === 'running') {
      this.#mishapTimer = setTimeout(() => this.#dismiss(), MISHAP_MS);
    }
    return [icon('warn'), element('span', { role: 'status', text }),
      ...(stopped && run === 'running' ? [this.#button('put_back', 'Put back on the lane',
        () => window.crgame.driving?.putBack(), 'At rest, where its lane is free (Backspace)',
        'drive-button primary')] : []),
      this.#button('look', run === 'running' ? 'Pause and look again' : 'Look again',
        () => this.#lookAgain(run), 'The last 10 s once more', 'drive-button'),
      this.#button('again', 'Begin anew', () => this.#order('reset'),
        'The same game from its first step (hold R)', 'drive-button'),
      this.#button('close', '', () => this.#dismiss(), 'Close this and drive on', 'icon-button')];
  }

  #dismiss() {
    const { status } = this.#store;
    const mine = window.crgame.driving?.seat;
    this.#told = status === null || !mine ? 0 : mishapsOf(this.#store, mine).length;
    this.#show();
  }

  /** @param {RunState} run */
  async #lookAgain(run) {
    if (run === 'running') {
      await this.#order('pause');
      await new Promise((resolve) => {
        const end = this.#store.on('status', (status) => {
          if (status.run !== 'running') {
            end();
            resolve(undefined);
          }
        });
      });
    }
    window.crgame.lastSeconds?.open();
  }

  /**
   * @param {Over} facts
   * @returns {Node[]}
   */
  #card(facts) {
    const { connected, stays } = facts;
    const title = element('h2', { text: facts.why.title });
    return [
      element('header', {}, title, this.#button('close', '', () => this.#close(),
        'Close this and look at the scene', 'icon-button')),
      element('p', { class: 'outcome-why', text: facts.why.text }),
      scoreBlock(facts.scored, facts.mine),
      table(facts),
      fileList(facts),
      ...(facts.figures.length > 0 ? figures(facts.figures) : []),
      connected && stays ? null : element('p', { class: 'outcome-gone', role: 'status',
        text: connected ? 'The program ends with this run.'
          : 'The program at the other end is no longer there: this is how it was last seen. '
            + 'Start it again to drive again.' }),
      element('div', { class: 'outcome-buttons' },
        this.#button('again', 'Again', () => this.#order('reset'),
          'The same game from its first step, with a recording of its own (hold R)',
          'drive-button primary', !connected || !stays),
        this.#button('next', 'Next game', () => window.crgame.scenario?.startNext(),
          'The next one of the list', 'drive-button', !connected || !stays),
        this.#button('another', 'Another game', () => this.#another(),
          'Choose a game or a scenario', 'drive-button', !connected || !stays),
        this.#button('look', 'Last 10 s', () => this.#lookAgain('ended'),
          'The last 10 s once more, at will slowed', 'drive-button')),
    ].filter((item) => item !== null);
  }

  /**
   * @param {string} text
   * @param {Awaiting|Ready} facts
   * @returns {Node[]}
   */
  #bar(text, facts) {
    const drive = facts.phase === 'driver' && facts.holder === null
      ? this.#button('drive', `Drive ${facts.seat}`, () => this.#drive(facts.seat),
        `Take the seat of ${facts.seat}`, 'drive-button primary') : null;
    const start = facts.run === 'paused' ? this.#button('start', 'Start',
      () => this.#order('start'), 'Begin (P)',
      `drive-button ${facts.phase === 'ready' ? 'primary' : ''}`) : null;
    return [element('span', { role: 'status', text }), drive, start].filter(
      (item) => item !== null);
  }

  #reopen() {
    return this.#button('reopen', 'How it went', () => {
      this.#closedEpoch = -1;
      this.#show();
    }, 'Show the result of the run', 'drive-button');
  }

  /**
   * @param {string} action
   * @param {string} text
   * @param {() => void} act
   * @param {string} title
   * @param {string} kind
   * @param {boolean} [disabled]
   */
  #button(action, text, act, title, kind, disabled = false) {
    return element('button', { type: 'button', class: kind, 'data-action': action, title, disabled,
      'aria-label': text || title, on: { click: (event) => {
        // A button that kept the focus would be pressed by the space bar, which brakes.
        /** @type {HTMLElement} */ (event.currentTarget).blur();
        act();
      } } }, action === 'close' ? icon('close') : document.createTextNode(text));
  }

  #close() {
    this.#closedEpoch = this.#store.status?.epoch ?? -1;
    this.#show();
  }

  #another() {
    /** @type {HTMLElement|null} */
    const tab = document.querySelector('#tab-scenario');
    tab?.click();
  }

  /** @param {string} seat */
  #drive(seat) {
    const { driving } = window.crgame;
    if (driving !== undefined) {
      this.#ask(driving.claim(seat));
    }
  }

  /** @param {RunAction} action */
  #order(action) {
    return this.#ask(this.#connection.request({ type: 'control', action }));
  }

  /** @param {Promise<Reply>} reply */
  async #ask(reply) {
    const { ok, text } = await reply;
    if (!ok) {
      this.#store.receive({ type: 'notice', level: 'warn', text });
    }
  }
}

/** @param {Awaiting} facts */
function driverText({ seat, run, holder, holderName, me }) {
  if (holder === null) {
    return run === 'waiting' ? `The run begins as soon as somebody drives ${seat}.`
      : `${seat} waits for its driver.`;
  }
  const whose = holder === me ? 'your hands are' : `the hands of ${oneLine(holderName)} are`;
  return `${seat} waits: ${whose} off the controls.`;
}

/**
 * Make the card.
 *
 * @param {HTMLElement} root #outcome
 * @param {Store} store
 * @param {Connection} connection
 * @returns {Outcome}
 */
export function createOutcome(root, store, connection) {
  return new Outcome(root, store, connection);
}
