// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The lobby before a run: who is ready, the buttons of a driver and a director, the countdown. */

import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { Lobby } from '../../page/cockpit/js/lobby.js';
import { click, liveStore, openPage, RIGHTS, Server, textOf } from './dom_support.mjs';

const VEHICLES = ['hv0', 'hv1'].map((id) => ({ id, role: 'human' }));
const FREE = { source: 'cockpit', driver: 'cockpit', holder: null, holder_name: null,
  ready: false };
const MINE = { ...FREE, holder: 'c1', holder_name: 'Ada' };
const BOBS = { ...FREE, holder: 'c2', holder_name: 'Bob' };
const PLANNED = { ...FREE, source: 'planner', driver: 'planner' };

let panel, stage, server, store;

beforeEach(() => {
  openPage('<div id="stage"></div><section id="panel-drive"><p>below</p></section>');
  [panel, stage] = ['panel-drive', 'stage'].map((id) => document.getElementById(id));
  server = new Server();
  store = liveStore(VEHICLES);
  new Lobby(stage, store, server);
});

const status = (more) => store.receive({ type: 'status', run: 'waiting', n: 0, t: 0, epoch: 0,
  countdown_s: 0, ...more });
const show = (seats) => store.receive({ type: 'seats', seats });
const lobby = () => panel.querySelector('.lobby');
const rows = () => [...lobby().querySelectorAll('li')].map((line) => textOf(line));
const note = () => lobby().querySelector('[role=status]').textContent;
const [ready, all] = [0, 1].map((at) => () => lobby().querySelectorAll('button')[at]);
const countdown = () => textOf(stage);

test('each seat of a person says who drives it and whether they are ready', () => {
  status();
  show({ hv0: { ...MINE, ready: true }, hv1: BOBS, hv2: FREE, av0: PLANNED,
    hv3: { ...FREE, source: 'game', driver: 'joy' } });
  assert.equal(panel.firstElementChild, lobby());
  assert.deepEqual(rows(), ['hv0 You drive ready',
    'hv1 Driven by Bob in a cockpit not ready yet', 'hv2 Waits for a driver in a cockpit free']);
  assert.deepEqual([...lobby().querySelectorAll('[data-ready]')].map((line) => textOf(line)),
    ['hv0 You drive ready']);
});

test('an AV that somebody has taken over has no part in the lobby', () => {
  status();
  show({ hv0: FREE, av0: { ...PLANNED, source: 'cockpit', holder: 'c1' } });
  assert.deepEqual(rows(), ['hv0 Waits for a driver in a cockpit free']);
  assert.ok(ready().hidden);
});

test('the driver says ready and withdraws it', async () => {
  status();
  show({ hv0: FREE, hv1: MINE });
  assert.deepEqual([ready().textContent, ready().getAttribute('aria-pressed')],
    ['Ready', 'false']);
  await click(ready());
  assert.deepEqual(server.take(), [{ type: 'ready', seat: 'hv1', ready: true }]);
  show({ hv0: FREE, hv1: { ...MINE, ready: true } });
  assert.deepEqual([ready().textContent, ready().getAttribute('aria-pressed')],
    ['Withdraw ready', 'true']);
  await click(ready());
  assert.deepEqual(server.take(), [{ type: 'ready', seat: 'hv1', ready: false }]);
});

test('the button does not keep the focus, for the space bar brakes', async () => {
  status();
  show({ hv0: MINE });
  ready().focus();
  assert.equal(document.activeElement, ready());
  await click(ready());
  assert.notEqual(document.activeElement, ready());
});

test('who holds no seat has no readiness to say', () => {
  status();
  show({ hv0: BOBS, hv1: FREE });
  assert.ok(ready().hidden);
  // Before the server has named this page it holds no free seat.
  store.receive({ type: 'hello', client: '', name: '', mode: 'live', version: '1' });
  show({ hv0: { ...FREE, holder: '' } });
  assert.ok(ready().hidden);
});

test('a director starts for all, if there are two seats of people', async () => {
  status();
  show({ hv0: BOBS, hv1: FREE });
  assert.match(textOf(lobby()), /Start for all$/);
  await click(all());
  assert.deepEqual(server.take(), [{ type: 'control', action: 'start', all: true }]);
  show({ hv0: BOBS, av0: PLANNED });
  assert.ok(all().hidden);
  show({ hv0: BOBS, hv1: FREE });
  store.receive({ type: 'you', rights: RIGHTS.drive, accepted: true });
  assert.ok(all().hidden);
});

test('the note says for what the run waits', () => {
  const waits = 'The run begins after a countdown when all are ready.';
  status();
  show({ hv0: { ...MINE, ready: true }, hv1: BOBS });
  assert.equal(note(), waits);
  // A seat without a holder is not ready, whatever it says.
  show({ hv0: { ...MINE, ready: true }, hv1: { ...FREE, ready: true } });
  assert.equal(note(), waits);
  assert.equal(lobby().querySelectorAll('[data-ready]').length, 1);
  show({ hv0: { ...MINE, ready: true }, hv1: { ...BOBS, ready: true } });
  assert.equal(note(), 'All are ready: the run is starting.');
  status({ countdown_s: 3 });
  assert.equal(note(), 'Get ready: the run is starting.');
});

test('the countdown is over the picture, and ends with the start', () => {
  show({ hv0: { ...MINE, ready: true } });
  assert.equal(countdown(), '');
  status({ countdown_s: undefined });
  assert.equal(countdown(), '');
  for (const seconds of [3, 2, 1]) {
    status({ countdown_s: seconds });
    assert.equal(countdown(), String(seconds));
  }
  assert.equal(stage.querySelector('[role=timer]').getAttribute('aria-live'), 'assertive');
  status({ run: 'running', n: 1 });
  assert.equal(countdown(), '');
});

test('without a connection there is neither lobby nor countdown', () => {
  show({ hv0: MINE });
  status({ countdown_s: 2 });
  store.setConnected(false);
  assert.equal(countdown(), '');
  assert.ok(lobby().hidden);
  store.setConnected(true);
  assert.equal(countdown(), '2');
  assert.ok(!lobby().hidden);
});

test('there is a lobby before the first step only, also in a pause, and not in a recording',
  () => {
    show({ hv0: FREE });
    assert.ok(lobby().hidden);
    for (const [more, hidden] of [[{}, false], [{ run: 'paused' }, false],
      [{ run: 'running' }, true], [{ run: 'ended' }, true], [{ run: 'paused', n: 1 }, true]]) {
      status(more);
      assert.equal(lobby().hidden, hidden, JSON.stringify(more));
    }
    status();
    store.receive({ type: 'hello', client: 'c1', name: 'Ada', mode: 'replay', version: '1' });
    assert.ok(lobby().hidden);
  });

test('a game without seats of people has no lobby', () => {
  status();
  show({ av0: PLANNED });
  assert.ok(lobby().hidden);
});

test('a refusal of the server is a notice', async () => {
  const notices = [];
  store.on('notice', ({ level, text }) => notices.push([level, text]));
  server.reply = { ok: false, text: 'put your hands on the controls first' };
  status();
  show({ hv0: MINE, hv1: FREE });
  await click(ready());
  server.reply = { ok: false, text: 'nobody has a seat' };
  await click(all());
  assert.deepEqual(notices, [['warn', 'put your hands on the controls first'],
    ['warn', 'nobody has a seat']]);
});

test('names of people stay text', () => {
  const name = `<b>Bob</b> ${'o'.repeat(3000)}`;
  status();
  show({ hv0: { ...BOBS, holder_name: name }, hv1: { ...FREE, kept: { name: '<i>A</i>',
    for_s: 42 } } });
  assert.deepEqual(rows(), [`hv0 Driven by ${name} in a cockpit not ready yet`,
    'hv1 Kept for <i>A</i> for 42 s free']);
  assert.equal(lobby().querySelector('b, i'), null);
});
