// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The experimenter's panel of tasks: a card for each, its button, state and refusals. */

import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { createTaskPanel } from '../../page/cockpit/js/tasks/task_panel.js';
import { click, liveStore, openPage, RIGHTS, Server, textOf } from './dom_support.mjs';

const TASKS = [
  { name: 'light', kind: 'detection_response', label: '', seat: 'hv0', lead_s: null },
  { name: 'call', kind: 'take_over', label: 'Road works', seat: 'av0', lead_s: 2 },
  { name: 'radio', kind: 'secondary_task', label: '<b>Radio</b>\n\u202e1', seat: 'hv0',
    lead_s: null }];

let root, server, store;

beforeEach(() => {
  root = openPage();
  server = new Server();
  store = liveStore([], { tasks: TASKS });
  createTaskPanel(root, store, server);
});

const card = (name) => root.querySelector(`.task-panel [data-name="${name}"]`);
const button = (name) => card(name).querySelector('button');
const press = (name) => click(button(name));
const state = (name) => card(name).querySelector('.event-state').textContent;
const tasks = (running, ...open) => store.receive({ type: 'tasks', running, open });
const buttons = () => TASKS.map(({ name }) => button(name).textContent);
const usable = () => TASKS.map(({ name }) => !button(name).disabled);
const ALL = [true, true, true];
const NONE = [false, false, false];

test('each task has a card with its kind, its driver and its button, in the order of the game',
  () => {
    assert.deepEqual([...root.querySelectorAll('.task-panel [data-name]')].map(textOf), [
      'light Detection response Begin For the driver of hv0',
      'Road works Take-over request Ask For the driver of av0, 2.0 s ahead',
      '\u2068<b>Radio</b> \u202e1\u2069 Secondary task Begin For the driver of hv0']);
    assert.deepEqual(TASKS.map(({ name }) => button(name).getAttribute('aria-label')),
      ['Begin light', 'Ask Road works', 'Begin \u2068<b>Radio</b> \u202e1\u2069']);
    assert.ok(!root.querySelector('b'));
  });

test('a game without tasks has no panel', () => {
  store.receive({ ...store.scene, tasks: undefined });
  assert.ok(root.querySelector('.task-panel').hidden);
  assert.equal(textOf(root), '');
  store.receive({ ...store.scene, tasks: TASKS.slice(0, 1) });
  assert.ok(!root.querySelector('.task-panel').hidden);
  assert.equal(root.querySelectorAll('.task-panel [data-name]').length, 1);
});

test('a press triggers the task, and its button then ends it', async () => {
  await press('light');
  assert.deepEqual(server.take(), [{ type: 'trigger', event: 'light' }]);
  tasks(['light']);
  assert.deepEqual([buttons(), state('light')], [['End', 'Ask', 'Begin'], 'Goes on']);
  assert.equal(button('light').getAttribute('aria-label'), 'End light');
  await press('light');
  assert.deepEqual(server.take(), [{ type: 'trigger', event: 'light' }]);
  tasks([]);
  assert.deepEqual([buttons(), state('light')], [['Begin', 'Ask', 'Begin'], '']);
});

test('an open stimulus is told by its number', () => {
  tasks(['light'], { task: 'light', seat: 'hv0', number: 3, n: 1, seen: true });
  assert.deepEqual([state('light'), state('radio')], ['Stimulus 3', '']);
  assert.deepEqual(usable(), ALL);
});

test('a request is asked once, and it is told whether a page shows it', async () => {
  const open = { task: 'call', seat: 'av0', number: 1, n: 1, seen: false };
  tasks([], open);
  assert.equal(state('call'), 'No page shows it');
  assert.deepEqual(usable(), [true, false, true]);
  await press('call');
  assert.deepEqual(server.take(), []);
  tasks([], { ...open, seen: true });
  assert.equal(state('call'), 'Is shown');
  tasks([]);
  assert.equal(state('call'), '');
  await press('call');
  assert.deepEqual(server.take(), [{ type: 'trigger', event: 'call' }]);
});

test('a refusal of the server stays at its task as text, until the next press', async () => {
  server.reply = { ok: false, text: 'nobody\n <i>drives</i> av0' };
  await press('call');
  const alerts = () => TASKS.map(
    ({ name }) => card(name).querySelector('[role=alert]').textContent);
  assert.deepEqual(alerts(), ['', 'nobody <i>drives</i> av0', '']);
  server.reply = { ok: true, text: '' };
  await press('call');
  assert.deepEqual(alerts(), ['', '', '']);
});

test('a person who does not direct is told why', async () => {
  store.receive({ type: 'you', rights: RIGHTS.drive });
  assert.deepEqual(usable(), NONE);
  assert.equal(button('light').title,
    'Only a director can begin or end tasks; you are a driver.');
  await press('light');
  assert.deepEqual(server.take(), []);
  store.receive({ type: 'you', rights: { ...RIGHTS.drive, role: 'director', directs: true } });
  assert.deepEqual([usable(), button('light').hasAttribute('title')], [ALL, false]);
});

test('tasks need a connection, a live run, and one that has not ended', () => {
  const run = (value) => store.receive({ type: 'status', run: value, n: 0, epoch: 0 });
  store.setConnected(false);
  assert.deepEqual(usable(), NONE);
  store.setConnected(true);
  assert.deepEqual(usable(), ALL);
  run('ended');
  assert.deepEqual(usable(), NONE);
  run('paused');
  assert.deepEqual(usable(), ALL);
  store.receive({ type: 'hello', client: 'c1', name: 'Ada', mode: 'replay', version: '1' });
  assert.deepEqual(usable(), NONE);
});

test('a refusal for a task of an earlier scene goes nowhere', async () => {
  let answer;
  server.request = () => new Promise((resolve) => { answer = resolve; });
  await press('call');
  store.receive({ ...store.scene, tasks: TASKS.slice(0, 1) });
  answer({ ok: false, text: 'too late' });
  await click(button('light'));
  assert.doesNotMatch(textOf(root), /too late/);
});
