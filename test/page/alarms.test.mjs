// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Alarms: their words in the header, and the frame and signs around the world. */

import assert from 'node:assert/strict';
import { afterEach, beforeEach, mock, test } from 'node:test';

import { createAlarms } from '../../page/cockpit/js/panels/alarms.js';
import { Store } from '../../page/cockpit/js/store.js';
import { click, liveStore, openPage, textOf } from './dom_support.mjs';

const PAGE = '<div id="alarms" role="alert"></div><div id="alarm-frame" hidden></div>'
  + '<div id="alarm-signs"></div>';
const VEHICLES = [{ id: 'hv0', role: 'human' }, { id: 'av0', role: 'autonomous' }];
const LOST = 'This page has lost its connection to the simulation and tries to get it back.';

let store, root, frame, signs, alarms;

beforeEach(() => {
  mock.timers.enable({ apis: ['setTimeout'] });
  openPage(PAGE);
  [root, frame, signs] = ['alarms', 'alarm-frame', 'alarm-signs'].map(
    (id) => document.getElementById(id));
  store = liveStore(VEHICLES);
  globalThis.window.crgame = { world: { followed: 'av0' } };
  alarms = createAlarms(root, store);
});

afterEach(() => mock.timers.reset());

const alarm = (kind, subject, more) => ({
  id: `${kind}-${subject}`, kind, subject, text: `${kind} of ${subject}`, ...more });
const show = (...active) => store.receive({ type: 'alarms', active });
const status = (run) => store.receive({ type: 'status', run, n: 1, t: 0.1, epoch: 0 });
const drive = (id) => store.receive({ type: 'seats', seats: {
  [id]: { source: 'cockpit', driver: 'cockpit', holder: 'c1' } } });
const chip = (kind) => root.querySelector(`[data-kind="${kind}"]`);
const framed = () => (frame.hidden ? null : [frame.dataset.kind, frame.className]);

test('without an alarm nothing is marked', () => {
  assert.deepEqual([alarms.kinds(), textOf(root), framed(), signs.children.length],
    [[], '', null, 0]);
});

test('each kind has its word, and names the vehicle but not the recorder', () => {
  show(alarm('collision', 'av0'), alarm('off_road', 'hv0'), alarm('lost_device', 'hv0'),
    alarm('stale_plan', 'av0'), alarm('recording', 'recorder'), alarm('late', 'simulation'),
    alarm('late_traffic', 'traffic'));
  assert.deepEqual([...root.children].map((node) => textOf(node)), ['Collision av0',
    'Off road hv0', 'Input lost hv0', 'Plan stale av0', 'Recording failed', 'Running late',
    'Traffic late']);
  assert.deepEqual([...root.querySelectorAll('.minor')].map(({ dataset }) => dataset.kind),
    ['stale_plan', 'recording', 'late', 'late_traffic']);
});

test('the whole text is a hint, with the time since when and how to acknowledge', async () => {
  show(alarm('collision', 'av0', { since_t: 12.34 }), alarm('recording', 'recorder'));
  assert.equal(chip('collision').title,
    'collision of av0 (since 12.3 s): click to acknowledge');
  assert.equal(chip('recording').title, 'recording of recorder: click to acknowledge');
  await click(chip('collision'));
  assert.equal(chip('collision').title, 'collision of av0 (since 12.3 s)');
});

test('only alarms of the driven vehicle frame the world, others are words', () => {
  drive('hv0');
  show(alarm('collision', 'av0'));
  assert.equal(framed(), null);
  assert.equal(signs.children.length, 0);
  assert.equal(textOf(root), 'Collision av0');
  show(alarm('collision', 'av0'), alarm('off_road', 'hv0'));
  assert.deepEqual(framed(), ['off_road', 'urgent']);
  assert.equal(signs.children.length, 1);
});

test('a page that drives nothing is framed by the vehicle that it follows', () => {
  show(alarm('off_road', 'hv0'));
  assert.equal(framed(), null);
  show(alarm('off_road', 'hv0'), alarm('collision', 'av0'));
  assert.deepEqual(framed(), ['collision', 'urgent']);
  globalThis.window.crgame.world.followed = null;
  show(alarm('off_road', 'hv0'));
  assert.deepEqual(framed(), ['off_road', 'urgent']);
});

test('the frame changes with the seat', () => {
  show(alarm('off_road', 'hv0'));
  assert.equal(framed(), null);
  drive('hv0');
  assert.deepEqual(framed(), ['off_road', 'urgent']);
});

test('an alarm that is about no vehicle frames every page', () => {
  drive('hv0');
  show(alarm('recording', 'recorder'));
  assert.deepEqual(framed(), ['recording', 'minor']);
});

test('an urgent alarm frames the world before a minor one, whatever came first', () => {
  show(alarm('stale_plan', 'av0'), alarm('late', 'simulation'));
  assert.deepEqual(framed(), ['stale_plan', 'minor']);
  assert.equal(signs.children.length, 2);
  show(alarm('stale_plan', 'av0'), alarm('late', 'simulation'), alarm('collision', 'av0'));
  assert.deepEqual(framed(), ['collision', 'urgent']);
  assert.deepEqual([signs.className, signs.dataset.kinds], ['urgent', 'collision']);
});

test('two alarms of one kind have two words and one sign', () => {
  show(alarm('collision', 'av0'), { ...alarm('collision', 'av0'), id: 'second' });
  assert.equal(root.children.length, 2);
  assert.equal(signs.children.length, 1);
});

test('an acknowledged alarm stays as a word and frames no more, until it comes anew',
  async () => {
    show(alarm('collision', 'av0'));
    await click(chip('collision'));
    assert.equal(framed(), null);
    assert.ok(chip('collision').classList.contains('known'));
    show(alarm('collision', 'av0', { since_t: 2 }));
    assert.equal(framed(), null);
    for (const after_ms of [1000, 4000]) {
      show();
      mock.timers.tick(after_ms);
      show(alarm('collision', 'av0'));
      assert.deepEqual(framed(), ['collision', 'urgent'], `after ${after_ms} ms`);
      await click(chip('collision'));
    }
  });

test('an alarm that has ended stays for 4 s, marked as such', () => {
  show(alarm('collision', 'av0'));
  show();
  assert.deepEqual(framed(), ['collision', 'urgent ended']);
  assert.ok(chip('collision').classList.contains('ended'));
  mock.timers.tick(3999);
  assert.deepEqual(alarms.kinds(), ['collision']);
  mock.timers.tick(1);
  assert.deepEqual([alarms.kinds(), textOf(root), framed(), signs.children.length],
    [[], '', null, 0]);
});

test('an alarm that comes again before it has gone is the same one, and stays', () => {
  show(alarm('off_road', 'av0'));
  show();
  mock.timers.tick(3000);
  show(alarm('off_road', 'av0'));
  assert.deepEqual(framed(), ['off_road', 'urgent']);
  mock.timers.tick(10000);
  assert.equal(root.children.length, 1);
  assert.ok(!chip('off_road').classList.contains('ended'));
});

test('in a pause nothing is late, but other alarms stay', () => {
  status('paused');
  show(alarm('late', 'simulation'), alarm('late_traffic', 'traffic'), alarm('collision', 'av0'));
  assert.deepEqual(alarms.kinds(), ['collision']);
  status('running');
  assert.deepEqual(alarms.kinds(), ['collision', 'late', 'late_traffic']);
  status('paused');
  assert.ok(chip('late').classList.contains('ended'));
  assert.ok(!chip('collision').classList.contains('ended'));
});

test('a recording shows what was late, also while it stands', () => {
  store.receive({ type: 'hello', client: 'c1', name: 'Ada', mode: 'replay', version: '1' });
  status('paused');
  show(alarm('late', 'simulation'));
  assert.deepEqual(alarms.kinds(), ['late']);
});

test('a lost connection is an alarm of the page itself, and ends with the next one', () => {
  store.setConnected(false);
  assert.equal(textOf(root), 'No connection');
  assert.equal(chip('connection').title, `${LOST}: click to acknowledge`);
  assert.deepEqual(framed(), ['connection', 'urgent']);
  store.setConnected(true);
  assert.deepEqual(framed(), ['connection', 'urgent ended']);
  mock.timers.tick(4000);
  assert.deepEqual(alarms.kinds(), []);
});

test('the end of the program after a run is no alarm', () => {
  status('ended');
  store.setConnected(false);
  assert.deepEqual(alarms.kinds(), []);
});

test('a page that has just been opened has 3 s to connect', () => {
  openPage(PAGE);
  const fresh = new Store();
  const opened = createAlarms(document.getElementById('alarms'), fresh);
  fresh.setConnected(false);
  mock.timers.tick(2999);
  assert.deepEqual(opened.kinds(), []);
  mock.timers.tick(1);
  assert.deepEqual(opened.kinds(), ['connection']);
});

test('an unknown kind is urgent and named as it is, and foreign texts stay text', () => {
  show(alarm('tyre_burst', 'av0', { text: '<img src=x>\nabc \u202etxet' }));
  assert.equal(textOf(root), 'tyre burst av0');
  assert.equal(root.querySelector('img'), null);
  assert.equal(chip('tyre_burst').title,
    '\u2068<img src=x> abc \u202etxet\u2069: click to acknowledge');
  assert.deepEqual(framed(), ['tyre_burst', 'urgent']);
});

test('a kind that names a member of all objects is a kind like others', () => {
  show(alarm('constructor', 'av0', { text: '' }));
  assert.equal(textOf(root), 'constructor av0');
});

test('the newest text of an alarm replaces the former one', () => {
  show(alarm('stale_plan', 'av0', { text: 'for 0.5 s' }));
  show(alarm('stale_plan', 'av0', { text: 'for 0.9 s' }));
  assert.equal(root.children.length, 1);
  assert.match(chip('stale_plan').title, /^for 0\.9 s/);
});
