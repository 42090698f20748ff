// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A page that shows the tasks of a running game, for tests of its lights and requests. */

import { setImmediate as soon } from 'node:timers/promises';

import { Tasks } from '../../page/cockpit/js/tasks/tasks.js';
import { liveStore, openPage, Pictures, send, Server } from './dom_support.mjs';

const TIMES = { shown_s: 1, latest_s: 2.5, lead_s: null, show: true, key: 'Enter', button: null };
export const LIGHT = { name: 'light', kind: 'detection_response', label: '', seat: 'hv0',
  ...TIMES };
export const CALL = { name: 'call', kind: 'take_over', label: 'Road <b>works</b>', seat: 'av0',
  ...TIMES, lead_s: 2 };
export const RADIO = { name: 'radio', kind: 'secondary_task', label: 'Radio', seat: 'hv0',
  ...TIMES, key: null };
export const NONE = { source: 'cockpit', driver: 'cockpit', holder: null };
export const MINE = { ...NONE, holder: 'c1' };
const VEHICLES = [{ id: 'hv0', role: 'human' }, { id: 'av0', role: 'autonomous' }];
export const ANSWER = { type: 'task', seat: 'hv0', task: 'light', what: 'answer' };

/** The parts of the present page, and what was heard of it. */
export let root, server, store, pictures, claimed, tones;
let painted;

/** Stands for the browser's sound; only the beeps are kept. */
class Beep extends EventTarget {
  constructor(_, { frequency }) {
    super();
    tones.push(this);
    this.pitch = frequency;
    this.ends = [];
  }

  connect = (next) => next;
  start() {}
  stop = (at) => this.ends.push(at);
}

class Gain {
  gain = { setValueAtTime() {}, linearRampToValueAtTime: (level) => tones.loudest.push(level) };
  connect = (next) => next;
}

/** Open the page of a person who drives hv0, before each test. */
export function openTasks() {
  root = openPage();
  pictures = new Pictures();
  [painted, claimed, tones] = [[], [], Object.assign([], { loudest: [] })];
  Object.assign(globalThis, {
    MessageChannel: class {
      port1 = { onmessage: null, close() {} };
      port2 = { postMessage: () => painted.push(() => this.port1.onmessage()) };
    },
    AudioContext: class { currentTime = 0; suspend() {} resume() {} },
    OscillatorNode: Beep, GainNode: Gain,
  });
  globalThis.window.crgame = { sound: { volume: 0.5 }, driving: {
    claim: async (seat) => claimed.push(seat), gamepads: { devices: [] } } };
  server = Object.assign(new Server(), { sent: [], send: (message) => server.sent.push(message) });
  begin({});
}

/**
 * Open the page in a running game.
 *
 * @param {object} more of the scene
 */
export function begin(more) {
  root.replaceChildren();
  store = liveStore(VEHICLES, { tasks: [LIGHT, CALL, RADIO], ...more });
  store.round_trip_ms = 20;
  new Tasks(root, store, server);
  run('running');
  seats({ hv0: MINE });
}

export const run = (state) => store.receive({ type: 'status', run: state, n: 300, epoch: 0 });
export const seats = (more) => store.receive(
  { type: 'seats', seats: { hv0: NONE, av0: NONE, ...more } });
export const tasks = (running, ...open) => store.receive({ type: 'tasks', running, open });
export const prompt = (task, number = 1, more = {}) => ({ task: task.name, seat: task.seat, number,
  n: 300, seen: false, ...more });
export const find = (name) => root.querySelector(`.task-${name}`);
export const sent = () => server.sent.splice(0);
export const enter = (more) => send(document.body, 'keydown', { key: 'Enter', code: 'Enter',
  timeStamp: pictures.now_ms, ...more });

/** Draw the next picture, which is on the screen 3 ms later. */
export async function picture(by_ms = 20) {
  pictures.draw(by_ms);
  pictures.now_ms += 3;
  painted.splice(0).forEach((tell) => tell());
  await soon();
}
