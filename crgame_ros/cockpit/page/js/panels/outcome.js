// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** What stands over the world while no run goes on: how the last went, or whom the next awaits. */

import { element, setAttribute } from '../dom.js';
import { clockTime, NONE, oneLine, plural } from './format.js';
import { icon } from './icons.js';
import { TABLE_I, valueOf } from './timing.js';

/** @import { Connection } from '../connection.js' */
/** @import { Contact, Files, Recording, Reply, RunAction, RunState } from '../messages.js' */
/** @import { Scene, Status } from '../messages.js' */
/** @import { Store } from '../store.js' */

// More of a kind are counted.
const MOST_TOLD = 5;
// In which words a figure of table I is said of a run that is over.
/** @type {Record<string, string>} */
const FINAL_NAMES = { final_error_ms: 'Lag at the end' };

/**
 * How a run went.
 *
 * @typedef {object} Result
 * @property {{title: string, text: string}} why
 * @property {boolean} stays
 * @property {number} t [s]
 * @property {boolean} driven
 * @property {(Contact & {part: string})[]} contacts
 * @property {{vehicle: string, t: number}[]} departures
 * @property {{id: string, name: string, accepted: number, refused: number, fallbacks: number}[]
 *   } planners
 * @property {[name: string, text: string, explanation: string][]} figures
 * @property {Recording} recording
 * @property {Files|null} files
 */

/**
 * What is to be said, by phase: that the run is over, that this was closed, that a driver is
 * awaited, that everything is ready.
 *
 * @typedef {{phase: 'over', connected: boolean} & Result} Over
 * @typedef {{phase: 'driver', seat: string, run: RunState, holder: string|null,
 *   holderName: string, me: string}} Awaiting
 * @typedef {{phase: 'ready'|'none', run: RunState, mine: string|null}} Ready
 * @typedef {{phase: 'none', run?: undefined}|{phase: 'closed'}|Over|Awaiting|Ready} Facts
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
    if (!connected || status.n !== 0 || !['waiting', 'paused'].includes(status.run)) {
      return { phase: 'none' };
    }
    const [seat] = status.awaited ?? [];
    if (seat !== undefined) {
      return { phase: 'driver', seat, run: status.run, holder: seats[seat]?.holder ?? null,
        holderName: seats[seat]?.holder_name ?? '', me: me.id };
    }
    return { phase: status.run === 'paused' ? 'ready' : 'none', run: status.run,
      mine: Object.keys(seats).find((id) => seats[id].holder === me.id) ?? null };
  }

  /**
   * @param {Status} status
   * @param {Scene} scene
   * @returns {Result}
   */
  #result(status, scene) {
    const files = this.#files?.epoch === status.epoch ? this.#files : null;
    const { timing } = status;
    return {
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
      table(facts),
      ...(facts.figures.length > 0 ? figures(facts.figures) : []),
      fileList(facts),
      connected && stays ? null : element('p', { class: 'outcome-gone', role: 'status',
        text: connected ? 'The program ends with this run.'
          : 'The program at the other end is no longer there: this is how it was last seen. '
            + 'Start it again to drive again.' }),
      element('div', { class: 'outcome-buttons' },
        this.#button('again', 'Again', () => this.#order('reset'),
          'The same game from its first step, with a recording of its own',
          'drive-button primary', !connected || !stays),
        this.#button('another', 'Another game', () => this.#another(),
          'Choose a game or a scenario', 'drive-button', !connected || !stays)),
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

/** @param {Status} status */
function why({ reason, t }) {
  const after = clockTime(t);
  /** @param {string} text */
  const over = (text) => ({ title: 'The run is over', text });
  const [kind, , vehicle] = (reason ?? '').split(' ');
  switch (kind) {
    case 'duration': return over(`Its duration of ${after} is over.`);
    case 'stop': return over(`Somebody stopped it after ${after}.`);
    case 'signal': return over(`It was ended at the terminal after ${after}.`);
    case 'drivability':
      return over(`${vehicle} touched something or left the road after ${after}, `
        + 'which ends this game.');
    case 'silence': return { title: 'The simulation is silent',
      text: `It was heard last at ${after}. The terminal may tell why.` };
    default: return over(`It ended after ${after}.`);
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

/** @param {Result} facts */
function table(facts) {
  const rows = facts.driven ? [
    ['Contacts', told(facts.contacts, (item) => `${item.vehicle} with ${item.with}`,
      (item) => item.part)],
    ['Off the road', told(facts.departures, (item) => item.vehicle)],
  ] : [['Driven', 'by nobody: traffic was alone']];
  for (const { id, name, accepted, refused, fallbacks } of facts.planners) {
    rows.push([`${id}${name ? ` · ${oneLine(name)}` : ''}`, [
      `${plural(accepted, 'plan')} accepted`, `${refused} refused`,
      plural(fallbacks, 'fallback')].join(', ')]);
  }
  return element('table', { class: 'figures' }, element('tbody', {}, ...rows.map(
    ([name, text]) => element('tr', {}, element('th', { scope: 'row', text: name }),
      element('td', { text })))));
}

/**
 * Which side of whom it was and who could have avoided it, once the timing report says so.
 *
 * @param {Contact} contact
 * @param {Files|null} files
 */
function part(contact, files) {
  const pair = [contact.vehicle, contact.with].sort().join();
  const named = files?.contacts?.find((item) => [item.vehicle, item.with].sort().join() === pair);
  return named === undefined ? ''
    : ` (${oneLine(named.side)} of ${named.vehicle}; could have avoided it: `
      + `${oneLine(named.avoidable_by)})`;
}

/**
 * @template {{t: number}} Item
 * @param {Item[]} items
 * @param {(item: Item) => string} name
 * @param {(item: Item) => string} remark = () => ''
 */
function told(items, name, remark = () => '') {
  if (items.length === 0) {
    return 'none';
  }
  const texts = items.slice(0, MOST_TOLD).map(
    (item) => `${name(item)} at ${clockTime(item.t)}${remark(item)}`);
  const more = items.length - texts.length;
  return [...texts, ...(more > 0 ? [`${more} more`] : [])].join('; ');
}

/** @param {Result['figures']} items */
function figures(items) {
  return [element('h3', { text: 'How it kept time (table I)' }),
    element('dl', { class: 'outcome-figures' }, ...items.map(
      ([name, text, explanation]) => element('div', { title: explanation },
        element('dt', { text: name }), element('dd', { text: text || NONE }))))];
}

/** @param {Over} facts */
function fileList({ files, recording, connected }) {
  if (recording?.state === 'failed') {
    return element('p', { class: 'field-error', text: oneLine(recording.text) });
  }
  if (files === null) {
    return null;
  }
  return element('div', { class: 'outcome-files', 'data-complete': files.complete },
    element('span', { class: 'dim', text: 'Files in ' }), element('code', { text: files.folder }),
    element('ul', {}, ...files.names.map((text) => element('li', { text }))),
    files.complete || !connected ? null : element('span', { class: 'dim', role: 'status',
      text: 'Scenario and timing report are being written …' }));
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
