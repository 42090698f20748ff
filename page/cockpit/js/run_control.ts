// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The run in the header: start, pause, step, reset, stop, speed of time, clock, recording. */

import { element, part, setAttribute, setText, svg } from './dom.js';
import { isCommand } from './driving/focus.js';
import { confirm } from './panels/confirm.js';
import { clockTime, NONE } from './panels/format.js';
import { reasonAgainst, reasonAgainstOrder, tellRefusal } from './rights.js';

import type { Connection } from './connection.js';
import type { Recording, RequestMessage, RunAction, Status } from './messages.js';
import type { Store } from './store.js';

// The states of the run in which an order applies, its key and its text.
export interface Order {
  label: string;
  key?: string; // code of the key on the keyboard
  in: string[]; // which states of the run
  title: string;
  confirm?: [question: string, consequence: string];
}

const ORDERS: Record<RunAction, Order> = {
  start: { label: 'Start', key: 'KeyP', in: ['waiting', 'paused'], title: 'Start or go on (P)' },
  pause: { label: 'Pause', key: 'KeyP', in: ['running'],
    title: 'Pause: vehicles, planners and recording stand still (P)' },
  step: { label: 'Step', key: 'KeyN', in: ['waiting', 'paused'], title: 'One scenario step (N)' },
  reset: { label: 'Reset', in: ['waiting', 'running', 'paused', 'ended'],
    title: 'Begin anew at the first step',
    confirm: ['Reset the run?', 'All vehicles go back to where they began. The recording so far '
      + 'is kept; a new one begins.'] },
  stop: { label: 'Stop', in: ['waiting', 'running', 'paused'], title: 'End the run',
    confirm: ['Stop the run?',
      'It ends for everybody and its recording is closed. It cannot go on afterwards.'] },
};
const ACTIONS = Object.keys(ORDERS) as RunAction[];
const FACTORS = [0.1, 0.2, 0.25, 0.5, 1, 2, 3, 5, 10];
const RUN_TEXTS: Record<string, string> = {
  waiting: 'Waiting', running: 'Running', paused: 'Paused', ended: 'Ended',
};

/** The run control; one per page. */
export class RunControl {
  #store;
  #connection;
  #buttons = {} as Record<RunAction, HTMLButtonElement>;
  #factor = element('select', { 'aria-label': 'Real-time factor',
    title: 'Simulated seconds per second' });
  #root;
  #clock;
  #lamp;

  constructor(root: HTMLElement, store: Store, connection: Connection) {
    this.#store = store;
    this.#connection = connection;
    this.#root = part(root, 'run-control');
    this.#clock = buildClock(part(root, 'clock'));
    this.#lamp = buildLamp(part(root, 'recording'));
    for (const action of ACTIONS) {
      const order = ORDERS[action];
      this.#buttons[action] = element('button', { type: 'button', class: 'run-button',
        'data-action': action, title: order.title, 'aria-label': order.label,
        'aria-keyshortcuts': order.key?.slice(-1), on: { click: () => this.#order(action) } },
      icon(action), element('span', { class: 'run-label', text: order.label }));
    }
    this.#offer(1);
    this.#factor.addEventListener('change', () => this.#setFactor());
    this.#root.append(...Object.values(this.#buttons),
      element('label', { class: 'run-factor' }, element('span', { text: 'Speed' }), this.#factor));
    window.addEventListener('keydown', (event) => this.#key(event));
    store.on(['hello', 'you', 'status', 'connection', 'seats'], () => this.#show());
    this.#show();
  }

  #show() {
    const { status, connected, mode } = this.#store;
    setAttribute(this.#root, 'hidden', mode === 'replay');
    setAttribute(this.#lamp.node, 'hidden', mode === 'replay' || status === null);
    for (const action of ACTIONS) {
      const reason = reasonAgainstOrder(this.#store, action);
      setAttribute(this.#buttons[action], 'disabled', !connected || !status
        || !ORDERS[action].in.includes(status.run) || reason !== '');
      setAttribute(this.#buttons[action], 'title', reason || ORDERS[action].title);
    }
    const slow = reasonAgainst(this.#store, 'direct', 'change the speed of time');
    setAttribute(this.#factor, 'disabled', !connected || !status || status.run === 'ended'
      || slow !== '');
    setAttribute(this.#factor, 'title', slow || 'Simulated seconds per second');
    setAttribute(this.#clock.node, 'hidden', status === null);
    if (status) {
      this.#clock.show(status, connected);
      this.#lamp.show(recordingNow(status, connected));
      if (document.activeElement !== this.#factor) {
        this.#offer(status.real_time_factor ?? 1);
      }
    }
  }

  /** List the usual factors, and the present one if it differs. */
  #offer(present: number) {
    const factors = [...new Set([...FACTORS, present])].sort((a, b) => a - b);
    if (factors.length !== this.#factor.options.length
        || !factors.every((f, i) => Number(this.#factor.options[i].value) === f)) {
      this.#factor.replaceChildren(...factors.map((factor) => element('option',
        { value: factor, text: `× ${factor}` })));
    }
    this.#factor.value = String(present);
  }

  async #setFactor() {
    const factor = Number(this.#factor.value);
    // A select that keeps the focus would take the driving keys.
    this.#factor.blur();
    await this.#request({ type: 'rate', factor });
    this.#show();
  }

  async #order(action: RunAction) {
    const order = ORDERS[action];
    if (!order.confirm || await confirm(...order.confirm, order.label)) {
      await this.#request({ type: 'control', action });
    }
  }

  #request(message: RequestMessage) {
    return tellRefusal(this.#store, this.#connection.request(message));
  }

  #key(event: KeyboardEvent) {
    if (event.repeat || !isCommand(event) || this.#root.hidden
        // A driver may press a key by mistake; only a director controls the experiment.
        || reasonAgainst(this.#store, 'direct', 'pause') !== '') {
      return;
    }
    const action = ACTIONS.find((name) => ORDERS[name].key === event.code
      && !this.#buttons[name].disabled);
    if (action) {
      event.preventDefault();
      this.#order(action);
    }
  }
}

function buildClock(node: HTMLElement) {
  const time = element('span', { class: 'clock-time', text: NONE });
  const step = element('span', { class: 'clock-step' });
  const factor = element('span', { class: 'clock-factor', title: 'Measured real-time factor' });
  const state = element('span', { class: 'clock-state', role: 'status' });
  node.replaceChildren(time, element('span', { class: 'clock-small' }, step, factor), state);
  return {
    node,
    show({ t, k, measured_factor, run }: Status, connected: boolean) {
      setText(time, clockTime(t));
      setText(step, `k ${k ?? NONE}`);
      setText(factor, run === 'running' && Number.isFinite(measured_factor)
        ? `× ${Number(measured_factor).toFixed(2)}` : '');
      const told = connected || run === 'ended';
      setText(state, told ? RUN_TEXTS[run] ?? run : 'No connection');
      setAttribute(state, 'data-run', told ? run : 'lost');
    },
  };
}

function buildLamp(node: HTMLElement) {
  const text = element('span', { class: 'lamp-text' });
  node.replaceChildren(element('span', { class: 'lamp', 'aria-hidden': 'true' }), text);
  return {
    node,
    show({ state, megabytes, text: reason }: Recording) {
      setAttribute(node, 'data-state', state);
      const size = megabytes === undefined || !Number.isFinite(megabytes) ? ''
        : ` ${megabytes.toFixed(1)} MB`;
      setText(text, {
        recording: `Recording${size}`, recorded: `Recorded${size}`, unknown: '',
        failed: `Recording failed: ${reason || 'no reason given'}`, none: 'Not recording',
      }[state] ?? 'Not recording');
      setAttribute(node, 'title', reason || null);
    },
  };
}

/** Return the state of the recording, unknown without a connection unless the run was over. */
function recordingNow({ recording, run }: Status, connected: boolean): Recording {
  const told = recording ?? { state: 'none' };
  if (connected) {
    return told;
  }
  return run !== 'ended' ? { state: 'unknown' }
    : { ...told, state: told.state === 'recording' ? 'recorded' : told.state };
}

const PATHS: Record<RunAction, string> = {
  start: 'M6 4 L20 12 L6 20 Z',
  pause: 'M6 4 H10 V20 H6 Z M14 4 H18 V20 H14 Z',
  step: 'M4 4 L15 12 L4 20 Z M17 4 H20 V20 H17 Z',
  reset: 'M12 4 A8 8 0 1 1 4.6 9 L7.4 10.1 A5 5 0 1 0 12 7 V10 L6.5 5.5 L12 1 Z',
  stop: 'M5 5 H19 V19 H5 Z',
};

/** Draw the icon of an order, filled in the colour of the text around it. */
function icon(name: RunAction) {
  return svg('svg', { class: 'icon', viewBox: '0 0 24 24', 'aria-hidden': 'true' },
    svg('path', { d: PATHS[name] }));
}
