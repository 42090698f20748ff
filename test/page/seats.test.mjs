// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The list of seats: the buttons for each state of a seat, their requests, and the news. */

import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { Seats } from '../../page/cockpit/js/seats.js';
import { click, liveStore, openPage, RIGHTS, Server, textOf } from './dom_support.mjs';

const VEHICLES = [{ id: 'hv0', role: 'human' }, { id: 'av0', role: 'autonomous' }];
const FREE = { source: 'cockpit', driver: 'cockpit', holder: null };
const PLANNED = { source: 'planner', driver: 'planner', holder: null };

let root, server, store, driving;

beforeEach(() => {
  root = openPage();
  server = new Server();
  store = liveStore(VEHICLES, { planners: { av0: 'idm' } });
  driving = { seat: null, devices: document.createElement('div'), claimed: [], released: 0,
    claim: async (id) => { driving.claimed.push(id); return server.reply; },
    release: async () => { driving.released += 1; return server.reply; } };
  new Seats(root, store, server, driving);
});

const show = (hv0, av0 = PLANNED) => store.receive({ type: 'seats', seats: { hv0, av0 } });
const row = (id) => root.querySelector(`[data-seat="${id}"]`);
const buttons = (id) => [...row(id).querySelectorAll('button')].map(
  (button) => button.textContent);
const press = (id, text) => click([...row(id).querySelectorAll('button')].find(
  (button) => button.textContent === text));
const news = () => root.querySelector('.drive-news').textContent;

test('a free seat can be driven, and an AV taken over', async () => {
  show(FREE);
  assert.deepEqual([buttons('hv0'), buttons('av0')], [['Drive'], ['Take over']]);
  await press('hv0', 'Drive');
  await press('av0', 'Take over');
  assert.deepEqual(driving.claimed, ['hv0', 'av0']);
});

test('the holder gives the seat back, or hands it over to a person who accepts', async () => {
  show({ ...FREE, holder: 'c1', requests: [{ client: 'c2', name: 'Bob' }] });
  assert.deepEqual(buttons('hv0'), ['Hand over to Bob', 'Give back']);
  assert.ok(row('hv0').hasAttribute('data-mine'));
  await press('hv0', 'Hand over to Bob');
  await press('hv0', 'Give back');
  assert.deepEqual(server.take(), [{ type: 'hand_over', seat: 'hv0', to: 'c2' },
    { type: 'release', seat: 'hv0' }]);
  show({ ...FREE, holder: 'c1', offer: { client: 'c2', name: 'Bob' } });
  assert.deepEqual(buttons('hv0'), ['Withdraw the offer', 'Give back']);
  driving.seat = 'hv0';
  await press('hv0', 'Give back');
  assert.equal(driving.released, 1);
});

test('the seat of another person is asked for once, and an offer is accepted or declined',
  async () => {
    show({ ...FREE, holder: 'c2', holder_name: 'Bob' });
    await press('hv0', 'Ask for it');
    assert.deepEqual(server.take(), [{ type: 'ask', seat: 'hv0' }]);
    show({ ...FREE, holder: 'c2', holder_name: 'Bob', requests: [{ client: 'c1', name: 'Ada' }] });
    assert.deepEqual(buttons('hv0'), ['Asked']);
    await press('hv0', 'Asked');
    assert.deepEqual(server.take(), []);
    show({ ...FREE, holder: 'c2', holder_name: 'Bob', offer: { client: 'c1', name: 'Ada' } });
    await press('hv0', 'Accept');
    await press('hv0', 'Decline');
    assert.deepEqual(server.take(), [{ type: 'answer', seat: 'hv0', accept: true },
      { type: 'answer', seat: 'hv0', accept: false }]);
  });

test('an AV that its driver left can be given back to its planner', async () => {
  show(FREE, { ...PLANNED, source: 'cockpit' });
  assert.deepEqual(buttons('av0'), ['Take over', 'Give back']);
  await press('av0', 'Give back');
  assert.deepEqual(server.take(), [{ type: 'release', seat: 'av0' }]);
});

test('while it is kept for its driver, only a director can give it back', () => {
  const kept = { ...PLANNED, source: 'cockpit', kept: { name: 'Bob', for_s: 40 } };
  show(FREE, kept);
  assert.deepEqual(buttons('av0'), ['Take over', 'Give back']);
  store.receive({ type: 'you', rights: RIGHTS.drive });
  assert.deepEqual(buttons('av0'), ['Take over']);
});

test('a person without the right is told why, and asks nothing of the server', async () => {
  store.receive({ type: 'you', rights: RIGHTS.watch });
  show(FREE);
  await press('hv0', 'Drive');
  assert.deepEqual([driving.claimed, server.take()], [[], []]);
  assert.match(row('hv0').querySelector('button').title, /^Only a driver can take a seat/);
});

test('a refusal of the server is a notice', async () => {
  const notices = [];
  store.on('notice', ({ level, text }) => notices.push([level, text]));
  server.reply = { ok: false, text: 'the seat is kept for Bob' };
  show(FREE);
  await press('hv0', 'Drive');
  assert.deepEqual(notices, [['warn', 'the seat is kept for Bob']]);
});

test('the news says what has changed for this person', () => {
  show(FREE);
  show({ ...FREE, holder: 'c1' });
  assert.equal(news(), 'You drive hv0.');
  show({ ...FREE, holder: 'c1', requests: [{ client: 'c2', name: 'Bob' }] });
  assert.equal(news(), 'Bob asks for hv0.');
  show({ ...FREE, holder: 'c2', holder_name: 'Bob' });
  assert.equal(news(), 'hv0 is now driven by Bob.');
  show({ ...FREE, holder: 'c2', holder_name: 'Bob', offer: { client: 'c1', name: 'Ada' } });
  assert.equal(news(), 'Bob offers you hv0.');
  show({ ...FREE, holder: 'c1' });
  show(FREE);
  assert.equal(news(), 'hv0 is given back.');
});

test('after a broken connection the seat is kept, and no button works', async () => {
  show({ ...FREE, holder: 'c1' });
  store.setConnected(false);
  assert.equal(news(), 'The connection broke: hv0 is kept for you for a minute.');
  assert.match(textOf(row('hv0')), /Unknown without a connection/);
  assert.ok([...root.querySelectorAll('.seat button')].every((button) => button.disabled));
  store.setConnected(true);
  show({ ...FREE, holder: 'c1' });
  assert.ok(row('hv0').hasAttribute('data-mine'));
});

test('a lost input is said at the seat', () => {
  show({ ...FREE, holder: 'c1', lost: true });
  assert.equal(row('hv0').querySelector('[role=alert]').textContent,
    'No input: the vehicle brakes by itself');
});

test('a recording has no seats to take, and a game of traffic alone has none', () => {
  store.receive({ type: 'scene', time: { epoch: 0, dt_s: 0.01, dt_c_s: 0.1 }, vehicles: [],
    objects: [], events: [] });
  store.receive({ type: 'seats', seats: {} });
  assert.match(textOf(root), /only traffic: there is no seat to take/);
  store.receive({ type: 'hello', client: 'c1', name: 'Ada', mode: 'replay', version: '1' });
  assert.match(textOf(root), /This is a recording: its seats cannot be taken/);
  assert.doesNotMatch(textOf(root), /only traffic/);
});

test('the focus stays on the same button while the list changes', () => {
  show(FREE);
  root.querySelector('[data-key="hv0 Drive"]').focus();
  show(FREE, { ...PLANNED, source: 'cockpit' });
  assert.equal(document.activeElement.dataset.key, 'hv0 Drive');
});
