// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The panel of events: what each does, its button in each state, and the log of what happened. */

import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { createEvents } from '../../page/cockpit/js/panels/events.js';
import { Store } from '../../page/cockpit/js/store.js';
import { click, liveStore, openPage, RIGHTS, Server, textOf } from './dom_support.mjs';

const EVENTS = [
  { name: 'walk', label: 'Let the pedestrian cross', when: null, kind: 'release', object: '7' },
  { name: 'slow', label: '', when: { time: 12 }, kind: 'speed_limit', speed: 30 / 3.6,
    lanelets: [] },
];
const TIME = { epoch: 0, dt_s: 0.01, dt_c_s: 0.1 };

let root, server, store, panel;

beforeEach(() => {
  root = openPage();
  server = new Server();
  store = liveStore([], { events: EVENTS });
  panel = createEvents(root, store, server);
});

const status = (run) => store.receive({ type: 'status', run, n: 1, t: 0.1, epoch: 0 });
const fire = (...fired) => store.receive({ type: 'events', fired });
const cards = () => [...root.querySelectorAll('.event')];
const button = (label) => root.querySelector(`button[aria-label="Trigger ${label}"]`);
const states = () => cards().map((card) => [card.querySelector('button').textContent,
  card.querySelector('button').disabled]);
const log = () => [...root.querySelectorAll('.event-log li')].map((line) => textOf(line));

test('each event says what it does, and when it fires by itself', () => {
  assert.deepEqual(cards().map((card) => textOf(card)), [
    'Let the pedestrian cross Release Trigger Releases obstacle 7, which waits until then.',
    'slow Speed limit Trigger Sets the speed limit of all roads to 30 km/h. '
      + 'Also by itself at 12.0 s.',
  ]);
  assert.doesNotMatch(textOf(root), /no events|What has happened/);
});

test('the button asks the server once, and waits for the event', async () => {
  await click(button('Let the pedestrian cross'));
  assert.deepEqual(server.take(), [{ type: 'trigger', event: 'walk' }]);
  assert.deepEqual(states(), [['Sent …', true], ['Trigger', false]]);
  await click(button('Let the pedestrian cross'));
  assert.deepEqual(server.take(), []);
  fire({ name: 'walk', n: 250, k: 25, by: 'trigger' });
  assert.deepEqual(states(), [['Done', true], ['Trigger', false]]);
  assert.equal(cards()[0].querySelector('.event-state').textContent, '2.5 s, by button');
});

test('a refusal is said at the event, which can be tried again', async () => {
  server.reply = { ok: false, text: 'the pedestrian\n is <b>gone</b>' };
  await click(button('Let the pedestrian cross'));
  const [alert, other] = cards().map((card) => card.querySelector('[role=alert]'));
  assert.equal(alert.textContent, 'the pedestrian is <b>gone</b>');
  assert.equal(alert.querySelector('b'), null);
  assert.equal(other.textContent, '');
  assert.deepEqual(states(), [['Trigger', false], ['Trigger', false]]);
  server.reply = { ok: true, text: '' };
  await click(button('Let the pedestrian cross'));
  assert.equal(alert.textContent, '');
  assert.equal(server.take().length, 2);
});

test('an event can also be triggered by another part of the page', async () => {
  await panel.trigger('slow');
  assert.deepEqual(server.take(), [{ type: 'trigger', event: 'slow' }]);
  assert.deepEqual(states(), [['Trigger', false], ['Sent …', true]]);
});

test('what has happened is listed, the latest first, also what has no button', () => {
  fire({ name: 'slow', n: 1200, k: 120, by: 'condition' },
    { name: 'contact of hv0 with av0', n: 1310, k: 131, by: 'contact' },
    { name: 'put back hv0', n: 1405, k: 140, by: 'driver' },
    { name: 'walk', n: 1500, k: 150, by: 'a newer way' });
  assert.match(textOf(root), /What has happened/);
  assert.deepEqual(log(), ['15.0 s Let the pedestrian cross a newer way',
    '14.1 s put back hv0 by its driver', '13.1 s contact of hv0 with av0 stopped by it',
    '12.0 s slow by its condition']);
  assert.deepEqual(states(), [['Done', true], ['Done', true]]);
  assert.equal(cards()[1].querySelector('.event-state').textContent, '12.0 s, by its condition');
});

test('a replay that goes back in time takes an event back', () => {
  fire({ name: 'walk', n: 10, k: 1, by: 'trigger' });
  fire();
  assert.deepEqual(states(), [['Trigger', false], ['Trigger', false]]);
  assert.equal(cards()[0].querySelector('.event-state').textContent, '');
  assert.deepEqual(log(), []);
  assert.doesNotMatch(textOf(root), /What has happened/);
});

test('after a reset every event can be triggered anew', async () => {
  server.reply = { ok: false, text: 'not now' };
  await click(button('slow'));
  server.reply = { ok: true, text: '' };
  await click(button('Let the pedestrian cross'));
  store.receive({ type: 'events', fired: [] });
  store.restart(1);
  assert.deepEqual(states(), [['Trigger', false], ['Trigger', false]]);
  assert.equal(cards()[1].querySelector('[role=alert]').textContent, '');
});

test('who does not direct is told why, and asks nothing of the server', async () => {
  store.receive({ type: 'you', rights: RIGHTS.drive, accepted: true });
  assert.deepEqual(states(), [['Trigger', true], ['Trigger', true]]);
  assert.equal(button('slow').title, 'Only a director can trigger events; you are a driver.');
  await click(button('slow'));
  assert.deepEqual(server.take(), []);
  store.receive({ type: 'you', accepted: true,
    rights: { ...RIGHTS.drive, role: 'director', directs: true } });
  assert.equal(button('slow').hasAttribute('title'), false);
  assert.equal(button('slow').disabled, false);
});

test('no button works without a connection, after the end, or in a recording', () => {
  const none = [['Trigger', true], ['Trigger', true]];
  const all = [['Trigger', false], ['Trigger', false]];
  store.setConnected(false);
  assert.deepEqual(states(), none);
  store.setConnected(true);
  assert.deepEqual(states(), all);
  status('ended');
  assert.deepEqual(states(), none);
  status('paused');
  assert.deepEqual(states(), all);
  store.receive({ type: 'hello', client: 'c1', name: 'Ada', mode: 'replay', version: '1' });
  assert.deepEqual(states(), none);
});

test('another game has other events, and one without any says where they are written', () => {
  store.receive({ type: 'scene', time: TIME, vehicles: [], objects: [],
    events: [EVENTS[1]] });
  assert.deepEqual(cards().map((card) => card.querySelector('h3').textContent), ['slow']);
  store.receive({ type: 'scene', time: { ...TIME, epoch: 2 }, vehicles: [], objects: [],
    events: [] });
  assert.equal(cards().length, 0);
  assert.match(textOf(root), /This game has no events\. They are written under "events"/);
});

test('before the first game the panel says so', () => {
  const body = openPage();
  createEvents(body, new Store(), server);
  assert.equal(textOf(body), 'Trigger an event No scenario yet.');
});

test('texts of a game file stay text on one line', () => {
  const label = `<b>Bang</b>\nabc \u202etxet ${'x'.repeat(5000)}`;
  store.receive({ type: 'scene', time: { ...TIME, epoch: 1 }, vehicles: [], objects: [],
    events: [{ name: '<i>walk</i>', label, when: null, kind: 'release', object: '<u>7</u>' }] });
  fire({ name: '<i>walk</i>', n: 100, k: 10, by: 'trigger' },
    { name: '<s>other</s>', n: 200, k: 20, by: 'driver' });
  const shown = `\u2068<b>Bang</b> abc \u202etxet ${'x'.repeat(5000)}\u2069`;
  assert.equal(root.querySelector('h3').textContent, shown);
  assert.equal(root.querySelector('button').getAttribute('aria-label'), `Trigger ${shown}`);
  assert.deepEqual(log(), ['2.0 s <s>other</s> by its driver', `1.0 s ${shown} by button`]);
  assert.equal(root.querySelector('b, i, u, s'), null);
});
