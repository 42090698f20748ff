// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The card over the world until a run is over: the awaited driver, contacts, a held run. */

import assert from 'node:assert/strict';
import { afterEach, beforeEach, mock, test } from 'node:test';

import { Outcome } from '../../page/cockpit/js/panels/outcome.js';
import { click, liveStore, openPage, RIGHTS, Server, textOf } from './dom_support.mjs';

const VEHICLES = [{ id: 'hv0', role: 'human' }, { id: 'av0', role: 'autonomous' }];
const FREE = { source: 'cockpit', driver: 'cockpit', holder: null, holder_name: null };
const MINE = { ...FREE, holder: 'c1', holder_name: 'Ada' };
const HIT = { vehicle: 'hv0', with: 'av0', t: 4.2 };
const DIRECTOR = { ...RIGHTS.drive, role: 'director', directs: true, may_direct: true };

let root, server, store, did, latest;

beforeEach(() => {
  mock.timers.enable({ apis: ['setTimeout'] });
  openPage('<div id="outcome" hidden></div>');
  root = document.getElementById('outcome');
  did = [];
  globalThis.window.crgame = {
    driving: { seat: null, putBack: () => did.push('put back'),
      claim: async (id) => { did.push(`claim ${id}`); return server.reply; } },
    lastSeconds: { open: () => did.push('look') },
  };
  server = new Server();
  latest = { run: 'waiting', n: 0, t: 0, epoch: 0, stays: true, contacts: [], departures: [],
    planners: {}, recording: { state: 'none' }, timing: null };
  store = liveStore(VEHICLES, { contact: 'stop' });
  new Outcome(root, store, server);
});

afterEach(() => mock.timers.reset());

const status = (more) => {
  latest = { ...latest, ...more };
  store.receive({ type: 'status', ...latest });
};
const seat = (hv0) => {
  globalThis.window.crgame.driving.seat = hv0.holder === 'c1' ? 'hv0' : null;
  store.receive({ type: 'seats', seats: { hv0 } });
};
const be = (rights) => store.receive({ type: 'you', rights, accepted: true });
const phase = () => (root.hidden ? 'none' : root.dataset.phase);
const button = (action) => root.querySelector(`[data-action="${action}"]`);
const buttons = () => [...root.querySelectorAll('button')].map(({ dataset }) => dataset.action);
const blocked = () => [...root.querySelectorAll('button')].filter(({ disabled }) => disabled).map(
  ({ dataset, title }) => [dataset.action, title]);
const orders = () => server.take().map(({ type, action }) => `${type} ${action}`);
/** Drive hv0 into av0, in a run that goes on. */
const touch = () => {
  seat(MINE);
  status({ run: 'running', n: 430, t: 4.3, contacts: [HIT] });
};

test('before the first status, and while a run goes well, there is no card', () => {
  assert.equal(phase(), 'none');
  status({ run: 'running', n: 1 });
  assert.deepEqual([phase(), textOf(root)], ['none', '']);
});

test('a run that waits for a driver offers the free seat', async () => {
  seat(FREE);
  status({ awaited: ['hv0'] });
  assert.equal(textOf(root), 'The run begins as soon as a driver takes hv0. Drive hv0');
  await click(button('drive'));
  assert.deepEqual(did, ['claim hv0']);
  status({ run: 'paused' });
  assert.equal(textOf(root), 'hv0 waits for its driver. Drive hv0 Start');
});

test('a seat whose driver has no hands on the controls says whose they are', () => {
  seat(MINE);
  status({ awaited: ['hv0'] });
  assert.equal(textOf(root), 'hv0 waits: your hands are off the controls.');
  seat({ ...FREE, holder: 'c2', holder_name: '<b>Bob</b>\n\u202e' });
  assert.equal(textOf(root),
    'hv0 waits: the hands of \u2068<b>Bob</b> \u202e\u2069 are off the controls.');
  assert.equal(root.querySelector('b'), null);
});

test('when everything is ready the driver is told to start', async () => {
  status({ run: 'paused' });
  assert.equal(textOf(root), 'Everything stands at the first step. Start');
  seat(MINE);
  assert.equal(textOf(root), 'You drive hv0: start when you are ready. Start');
  await click(button('start'));
  assert.deepEqual(orders(), ['control start']);
  status({ run: 'running', n: 1 });
  assert.equal(phase(), 'none');
  status({ run: 'paused', n: 1 });
  assert.equal(phase(), 'none');
});

test('who may not drive or direct is told why before the start', async () => {
  be(RIGHTS.watch);
  seat(FREE);
  status({ run: 'paused', awaited: ['hv0'] });
  assert.deepEqual(blocked(), [
    ['drive', 'Only a driver can take a seat; you are a spectator.'],
    ['start', 'Only a director can start the run; you are a spectator.']]);
  await click(button('drive'));
  assert.deepEqual(did, []);
});

test('a contact is told to its driver at once, with what can be done', async () => {
  touch();
  assert.equal(textOf(root), 'You touched av0 at 4.2 s. Put back on the lane How it went '
    + 'Pause and look again Begin anew');
  await click(button('put_back'));
  await click(button('again'));
  assert.deepEqual([did, orders()], [['put back'], ['control reset']]);
});

test('the notice of a contact goes when it is closed or after 10 s, until the next one',
  async () => {
    touch();
    await click(button('close'));
    assert.equal(phase(), 'none');
    status({ n: 600, t: 6 });
    assert.equal(phase(), 'none');
    status({ departures: [{ vehicle: 'hv0', t: 6.5 }, { vehicle: 'av0', t: 7 }] });
    assert.match(textOf(root), /^You left the road at 6\.5 s\. How it went/);
    mock.timers.tick(9999);
    assert.equal(phase(), 'mishap');
    mock.timers.tick(1);
    assert.equal(phase(), 'none');
  });

test('the notice stays while the run stands', () => {
  touch();
  status({ run: 'paused' });
  mock.timers.tick(60000);
  assert.deepEqual(buttons(), ['hold', 'look', 'again', 'close']);
  assert.equal(button('look').textContent, 'Look again');
});

test('back on the lane the notice of the contact is gone', () => {
  touch();
  store.receive({ type: 'events', fired: [
    { name: 'put back hv9', n: 440, k: 44, by: 'driver' }] });
  assert.equal(phase(), 'mishap');
  store.receive({ type: 'events', fired: [
    { name: 'put back hv0', n: 450, k: 45, by: 'driver' }] });
  assert.equal(phase(), 'none');
});

test('a vehicle that a contact does not stop is not put back', () => {
  store.receive({ type: 'scene', time: { epoch: 1, dt_s: 0.01, dt_c_s: 0.1 },
    vehicles: VEHICLES, objects: [], events: [], contact: 'through' });
  touch();
  assert.deepEqual(buttons(), ['hold', 'look', 'again', 'close']);
});

test('the contact of another is no notice', () => {
  seat({ ...FREE, holder: 'c2', holder_name: 'Bob' });
  status({ run: 'running', n: 430, contacts: [HIT] });
  assert.equal(phase(), 'none');
});

test('a contact of the next run is told anew', async () => {
  touch();
  await click(button('close'));
  store.restart(1);
  status({ epoch: 1, contacts: [] });
  status({ epoch: 1, contacts: [{ ...HIT, t: 2 }] });
  assert.match(textOf(root), /^You touched av0 at 2\.0 s/);
});

test('the last seconds are shown once the run stands', async () => {
  touch();
  await click(button('look'));
  assert.deepEqual([orders(), did], [['control pause'], []]);
  status({ t: 4.4 });
  await click(document.body);
  assert.deepEqual(did, []);
  status({ run: 'paused' });
  await click(document.body);
  assert.deepEqual(did, ['look']);
});

test('a refused pause is a notice, and neither holds the run nor a later pause', async () => {
  const notices = [];
  store.on('notice', ({ level, text }) => notices.push([level, text]));
  server.reply = { ok: false, text: 'not now' };
  touch();
  await click(button('hold'));
  await click(button('look'));
  status({ run: 'paused' });
  await click(document.body);
  assert.deepEqual([notices, did], [[['warn', 'not now'], ['warn', 'not now']], []]);
  assert.equal(phase(), 'mishap');
});

test('a reset while the pause is awaited ends the wish to look', async () => {
  touch();
  await click(button('look'));
  store.restart(1);
  status({ run: 'paused', epoch: 1, n: 0, contacts: [] });
  await click(document.body);
  assert.deepEqual(did, []);
});

test('a connection that is lost while the pause is awaited ends the wish to look', async () => {
  touch();
  await click(button('look'));
  store.setConnected(false);
  await click(document.body);
  store.setConnected(true);
  status({ run: 'paused' });
  await click(document.body);
  assert.deepEqual(did, []);
});

/** Hold the run after a contact. */
const hold = async () => {
  touch();
  await click(button('hold'));
  status({ run: 'paused', t: 4.5 });
  await click(document.body);
};

test('a held run shows its result so far, and can go on', async () => {
  await hold();
  assert.equal(phase(), 'held');
  assert.match(textOf(root), /^Collision You touched av0 at 4\.2 s\. The run stands at 4\.5 s; /);
  assert.match(textOf(root), /No score: it is made when the run is over/);
  assert.match(textOf(root), /Contacts hv0 with av0 at 4\.2 s Off the road none/);
  server.take();
  await click(button('start'));
  assert.deepEqual(orders(), ['control start']);
  status({ run: 'running' });
  assert.equal(phase(), 'none');
  status({ run: 'paused' });
  assert.equal(phase(), 'none');
});

test('the card of a held run can be closed', async () => {
  await hold();
  await click(button('close'));
  assert.equal(phase(), 'none');
});

test('a held run is ended after a question', async () => {
  await hold();
  server.take();
  for (const [at, after] of [[0, []], [1, ['control stop']]]) {
    await click(button('stop'));
    assert.match(textOf(document.querySelector('dialog')), /^End the run\? It ends for every/);
    await click(document.querySelectorAll('dialog button')[at]);
    assert.deepEqual(orders(), after);
  }
});

test('the result of a run that ended while it was held is closed by the first click', async () => {
  await hold();
  status({ run: 'ended', reason: 'stop' });
  assert.equal(phase(), 'over');
  await click(button('close'));
  assert.equal(phase(), 'closed');
});

test('a mere driver gets the reason of each refusal, and nothing is asked', async () => {
  const reason = (deed) => `Only a director can ${deed} the run; you are a driver.`;
  be(RIGHTS.drive);
  touch();
  assert.deepEqual(blocked(), [['hold', reason('pause')], ['look', reason('pause')],
    ['again', reason('reset')]]);
  await click(button('hold'));
  assert.deepEqual(orders(), []);
  status({ run: 'paused' });
  assert.deepEqual(blocked(), [['again', reason('reset')]]);
  status({ run: 'ended', reason: 'duration' });
  const choose = 'Only a director can choose what is run; you are a driver.';
  assert.deepEqual(blocked(), [['again', reason('reset')], ['next', choose],
    ['another', choose]]);
  assert.equal(root.querySelector('.outcome-gone').textContent, choose);
  be(DIRECTOR);
  assert.deepEqual([blocked(), root.querySelector('.outcome-gone')], [[], null]);
});

test('without a connection nothing is awaited, and no contact is told', () => {
  status({ run: 'paused' });
  store.setConnected(false);
  assert.equal(phase(), 'none');
  touch();
  assert.equal(phase(), 'none');
});

test('a recording has no card', () => {
  store.receive({ type: 'hello', client: 'c1', name: 'Ada', mode: 'replay', version: '1' });
  status({ run: 'ended', reason: 'duration' });
  assert.equal(phase(), 'none');
});
