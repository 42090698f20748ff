// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The card over the world: the result or state of a run, or the driver that it awaits. */

import { scoreBlock } from '../after/score.js';
import { element, setAttribute } from '../dom.js';
import { reasonAgainst, reasonAgainstOrder, reasonAgainstSeat, tellRefusal } from '../rights.js';
import { confirm } from './confirm.js';
import { clockTime, oneLine } from './format.js';
import { icon } from './icons.js';
import { figures, fileList, RunResult, table } from './outcome_card.js';

import type { Connection } from '../connection.js';
import type { RunAction, RunState } from '../messages.js';
import type { Store } from '../store.js';
import type { Result } from './outcome_card.js';

// How long a mishap is shown to its driver while the run continues [ms].
const MISHAP_MS = 10000;

/** Why this person cannot do each of these; empty if they can. */
export type Against = Record<'start' | 'pause' | 'stop' | 'reset' | 'choose', string>;

// The content by phase: the run is over or held for inspection, the card was closed, a driver
// is awaited, everything is ready, or this page's driver had a contact or left the road.
export interface Card extends Result {
  phase: 'over' | 'held';
  connected: boolean;
  against: Against;
}

export interface Awaiting {
  phase: 'driver';
  seat: string;
  run: RunState;
  holder: string | null;
  holderName: string;
  me: string;
  refused: string;
  against: Against;
}

export interface Ready {
  phase: 'ready' | 'none';
  run: RunState;
  mine: string | null;
  against: Against;
}

export interface MishapFacts {
  phase: 'mishap';
  run: RunState;
  text: string;
  stopped: boolean;
  against: Against;
}

export type Facts = { phase: 'none'; run?: undefined } | { phase: 'closed' } | Card | Awaiting
  | Ready | MishapFacts;

/** The card; one per page. */
export class Outcome {
  #root;
  #store;
  #connection;
  #result;
  #shown = '';
  #closedEpoch = -1;
  #program = '';
  // Whether the run is held for inspection; mishaps of this run that have been shown.
  #held = false;
  #told = 0;
  #mishapTimer = 0;

  constructor(root: HTMLElement, store: Store, connection: Connection) {
    this.#root = root;
    this.#store = store;
    this.#connection = connection;
    this.#result = new RunResult(store, () => this.#show());
    store.on('hello', ({ program = '' }) => {
      if (program !== this.#program) {
        this.#program = program;
        this.#closedEpoch = -1;
        this.#result.clearFiles();
      }
    });
    store.on(['hello', 'you', 'scene', 'seats', 'status', 'connection'], () => this.#show());
    store.on('epoch', () => {
      this.#told = 0;
      this.#held = false;
    });
    store.on('status', ({ run }) => {
      this.#held &&= run !== 'running' && run !== 'ended';
    });
    store.on('events', ({ fired }) => {
      // Back on the lane: the notice of the contact is no longer needed.
      const last = fired.at(-1);
      if (last?.by === 'driver' && last.name.endsWith(` ${window.crgame.driving?.seat}`)) {
        this.#dismiss();
      }
      this.#show();
    });
    this.#show();
  }

  /** Rebuild the card only if it has changed: the user may be about to press a button. */
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
      const again: HTMLElement | null = this.#root.querySelector(`[data-action="${focused}"]`);
      again?.focus();
    }
  }

  #content(facts: Facts): Node[] {
    switch (facts.phase) {
      case 'none': return [];
      case 'over': case 'held': return this.#card(facts);
      case 'closed': return [this.#reopen()];
      case 'mishap': return this.#mishap(facts);
      case 'driver': return this.#bar(driverText(facts), facts);
      case 'ready': return this.#bar(facts.mine
        ? `You drive ${facts.mine}: start when you are ready.`
        : 'Everything stands at the first step.', facts);
    }
  }

  #facts(): Facts {
    const { status, scene, mode, connected, seats, me } = this.#store;
    if (mode !== 'live' || status === null || scene === null) {
      return { phase: 'none' };
    }
    const against = this.#against();
    if (status.run === 'ended' && status.reason !== 'reset') {
      if (this.#closedEpoch === status.epoch) {
        return { phase: 'closed' };
      }
      return { phase: 'over', connected, against, ...this.#result.of(status, scene) };
    }
    const mine = this.#store.own[0] ?? null;
    const mishaps = mine === null || !connected ? [] : mishapsOf(this.#store, mine);
    const last = mishaps.at(-1);
    if (this.#held && status.run === 'paused' && last !== undefined) {
      return { phase: 'held', connected, against, ...this.#result.of(status, scene),
        why: { title: last.touched ? 'Collision' : 'Off the road',
          text: `${last.text} The run stands at ${clockTime(status.t)}; its score, report and `
            + 'recording are there when it is over.' } };
    }
    if (last !== undefined && mishaps.length > this.#told) {
      return { phase: 'mishap', run: status.run, text: last.text, against,
        stopped: last.touched && scene.contact === 'stop' };
    }
    if (!connected || status.n !== 0 || !['waiting', 'paused'].includes(status.run)) {
      return { phase: 'none' };
    }
    const [seat] = status.awaited ?? [];
    if (seat !== undefined) {
      return { phase: 'driver', seat, run: status.run, holder: seats[seat]?.holder ?? null,
        holderName: seats[seat]?.holder_name ?? '', me: me.id, against,
        refused: seat in seats ? reasonAgainstSeat(this.#store, seat) : '' };
    }
    return { phase: status.run === 'paused' ? 'ready' : 'none', run: status.run, mine, against };
  }

  #against(): Against {
    const { connected, status } = this.#store;
    const gone = !connected ? 'There is no connection to the simulation.'
      : status?.run === 'ended' && !status.stays ? 'The program ends with this run.' : '';
    const [start, pause, stop, reset] = (['start', 'pause', 'stop', 'reset'] as const).map(
      (action) => gone || reasonAgainstOrder(this.#store, action));
    const choose = gone || reasonAgainst(this.#store, 'direct', 'choose what is run');
    return { start, pause, stop, reset, choose };
  }

  #mishap({ run, text, stopped, against }: MishapFacts): Node[] {
    const refused = run === 'running' ? against.pause : '';
    clearTimeout(this.#mishapTimer);
    if (run === 'running') {
      this.#mishapTimer = setTimeout(() => this.#dismiss(), MISHAP_MS);
    }
    return [icon('warn'), element('span', { role: 'status', text }),
      ...(stopped && run === 'running' ? [this.#button('put_back', 'Put back on the lane',
        () => window.crgame.driving?.putBack(), 'At rest, where its lane is free (Backspace)',
        'drive-button primary')] : []),
      this.#button('hold', 'How it went', () => this.#hold(),
        'Pause the run and show the result so far', 'drive-button', refused),
      this.#button('look', run === 'running' ? 'Pause and look again' : 'Look again',
        () => this.#openLastSeconds(), 'The last 10 s once more', 'drive-button', refused),
      this.#button('again', 'Begin anew', () => this.#order('reset'),
        'The same game from its first step (hold R)', 'drive-button', against.reset),
      this.#button('close', '', () => this.#dismiss(), 'Close this and drive on', 'icon-button')];
  }

  #dismiss() {
    const { status } = this.#store;
    const mine = window.crgame.driving?.seat;
    this.#told = status === null || !mine ? 0 : mishapsOf(this.#store, mine).length;
    this.#show();
  }

  async #openLastSeconds() {
    if (await this.#still()) {
      window.crgame.lastSeconds?.open();
    }
  }

  async #hold() {
    if (await this.#still()) {
      this.#held = true;
      this.#dismiss();
    }
  }

  /** @returns whether this run stands still now, paused if necessary */
  async #still(): Promise<boolean> {
    const { epoch, status } = this.#store;
    if (status?.run === 'running' && !await this.#order('pause')) {
      return false;
    }
    while (this.#store.connected && this.#store.status?.run === 'running') {
      await new Promise((resolve) => {
        const end = this.#store.on(['status', 'connection'], () => {
          end();
          resolve(undefined);
        });
      });
    }
    return this.#store.epoch === epoch && this.#store.status?.run !== 'running';
  }

  #card(facts: Card): Node[] {
    const { against, phase, why } = facts;
    const title = element('h2', { text: why.title });
    return [
      element('header', {}, title, this.#button('close', '', () => this.#close(),
        'Close this and look at the scene', 'icon-button')),
      element('p', { class: 'outcome-why', text: why.text }),
      scoreBlock(facts.scored, facts.mine),
      table(facts),
      fileList(facts),
      ...(facts.figures.length > 0 ? figures(facts.figures) : []),
      against.choose === '' ? null : element('p', { class: 'outcome-gone', role: 'status',
        text: facts.connected ? against.choose
          : 'The simulation program has ended. This page shows its last state. '
            + 'Start it again to drive again.' }),
      element('div', { class: 'outcome-buttons' },
        ...(phase === 'held' ? [
          this.#button('start', 'Go on', () => this.#order('start'),
            'From where it stands (P)', 'drive-button primary', against.start),
          this.#button('stop', 'End the run', () => this.#end(),
            'And have its score, its report and its recording', 'drive-button', against.stop),
        ] : []),
        this.#button('again', 'Again', () => this.#order('reset'),
          'The same game from its first step, with a recording of its own (hold R)',
          `drive-button ${phase === 'over' ? 'primary' : ''}`, against.reset),
        this.#button('next', 'Next game', () => window.crgame.scenario?.startNext(),
          'The next one of the list', 'drive-button', against.choose),
        this.#button('another', 'Another game', () => this.#another(),
          'Choose a game or a scenario', 'drive-button', against.choose),
        this.#button('look', 'Last 10 s', () => this.#openLastSeconds(),
          'Replay the last 10 s, in slow motion if you like', 'drive-button')),
    ].filter((item) => item !== null);
  }

  #bar(text: string, facts: Awaiting | Ready): Node[] {
    const drive = facts.phase === 'driver' && facts.holder === null
      ? this.#button('drive', `Drive ${facts.seat}`, () => this.#drive(facts.seat),
        `Take the seat of ${facts.seat}`, 'drive-button primary', facts.refused) : null;
    const start = facts.run === 'paused' ? this.#button('start', 'Start',
      () => this.#order('start'), 'Begin (P)',
      `drive-button ${facts.phase === 'ready' ? 'primary' : ''}`, facts.against.start) : null;
    return [element('span', { role: 'status', text }), drive, start].filter(
      (item) => item !== null);
  }

  #reopen() {
    return this.#button('reopen', 'How it went', () => {
      this.#closedEpoch = -1;
      this.#show();
    }, 'Show the result of the run', 'drive-button');
  }

  /** @param refused why it cannot be pressed */
  #button(action: string, text: string, act: () => void, title: string, kind: string,
    refused = '') {
    return element('button', { type: 'button', class: kind, 'data-action': action,
      title: refused || title, disabled: refused !== '',
      'aria-label': text || title, on: { click: (event) => {
        // A focused button would be pressed by the space bar, which brakes.
        (event.currentTarget as HTMLElement).blur();
        act();
      } } }, action === 'close' ? icon('close') : document.createTextNode(text));
  }

  #close() {
    if (this.#held) {
      this.#held = false;
    } else {
      this.#closedEpoch = this.#store.status?.epoch ?? -1;
    }
    this.#show();
  }

  async #end() {
    if (await confirm('End the run?', 'It ends for everybody and its recording is closed. It '
        + 'cannot go on afterwards.', 'End')) {
      this.#order('stop');
    }
  }

  #another() {
    const tab: HTMLElement | null = document.querySelector('#tab-scenario');
    tab?.click();
  }

  #drive(seat: string) {
    const { driving } = window.crgame;
    if (driving !== undefined) {
      tellRefusal(this.#store, driving.claim(seat));
    }
  }

  /** @returns whether it was done */
  #order(action: RunAction): Promise<boolean> {
    return tellRefusal(this.#store, this.#connection.request({ type: 'control', action }));
  }
}

function driverText({ seat, run, holder, holderName, me }: Awaiting) {
  if (holder === null) {
    return run === 'waiting' ? `The run begins as soon as a driver takes ${seat}.`
      : `${seat} waits for its driver.`;
  }
  const whose = holder === me ? 'your hands are' : `the hands of ${oneLine(holderName)} are`;
  return `${seat} waits: ${whose} off the controls.`;
}

interface Mishap { t: number; touched: boolean; text: string }

/**
 * Return the contacts and road departures of a vehicle, in the order of time.
 * @param mine the vehicle
 */
function mishapsOf({ status }: Store, mine: string): Mishap[] {
  const { contacts = [], departures = [] } = status ?? {};
  const touched = (t: number, other: string): Mishap => ({
    t, touched: true, text: `You touched ${oneLine(other)} at ${clockTime(t)}.` });
  return [
    ...contacts.filter((item) => item.vehicle === mine || item.with === mine).map(
      (item) => touched(item.t, item.vehicle === mine ? item.with : item.vehicle)),
    ...departures.filter(({ vehicle }) => vehicle === mine).map(({ t }) => ({
      t, touched: false, text: `You left the road at ${clockTime(t)}.` })),
  ].sort((a, b) => a.t - b.t);
}
