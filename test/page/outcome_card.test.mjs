// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The card of a run that is over: its result in words, its score and files, and what is next. */

import assert from 'node:assert/strict';
import { afterEach, beforeEach, mock, test } from 'node:test';

import { Outcome } from '../../page/cockpit/js/panels/outcome.js';
import { click, liveStore, openPage, Server, textOf } from './dom_support.mjs';

const VEHICLES = [{ id: 'hv0', role: 'human' }, { id: 'av0', role: 'autonomous' }];
const HIT = { vehicle: 'hv0', with: 'av0', t: 4.2 };
const PLANNER = { accepted: 1, refused: 2, fallbacks: 1, planner: 'mine.py:Mine' };
const FILES = { epoch: 0, run: 'run/2 a', folder: 'run/run_2', complete: true, contacts: [],
  names: ['report.html', 'game.yaml', 'bag', 'timing.json'] };
const SCORED = (vehicle, role, score) => ({ vehicle, role, score, remarks: ['it never moved'],
  distance: 123.4, fastest: 10, parts: [
    { name: 'Progress', value: 0.5, weight: 5, definition: 'along the route' },
    { name: 'No collision', value: null, weight: 0, definition: 'at fault' }] });

let root, server, store, did, latest, asked, answer;

beforeEach(() => {
  openPage('<button id="tab-scenario"></button><div id="outcome" hidden></div>');
  root = document.getElementById('outcome');
  did = [];
  asked = [];
  answer = { vehicles: [], refusal: '' };
  mock.method(globalThis, 'fetch', async (path) => {
    asked.push(path);
    if (answer === null) {
      throw new TypeError('Failed to fetch');
    }
    return new Response(JSON.stringify(answer));
  });
  globalThis.window.crgame = { lastSeconds: { open: () => did.push('look') },
    scenario: { startNext: () => did.push('next') } };
  document.getElementById('tab-scenario').addEventListener('click', () => did.push('choose'));
  server = new Server();
  latest = { run: 'running', n: 1, t: 30, epoch: 0, stays: true, contacts: [], departures: [],
    planners: {}, recording: { state: 'recorded' }, timing: null };
  store = liveStore(VEHICLES, { planners: { av0: 'idm' } });
  new Outcome(root, store, server);
});

afterEach(() => mock.restoreAll());

const status = (more) => {
  latest = { ...latest, ...more };
  store.receive({ type: 'status', ...latest });
};
const end = (reason, more) => status({ run: 'ended', reason, ...more });
const files = (more) => store.receive({ type: 'files', ...FILES, ...more });
const settle = async () => {
  for (let turn = 0; turn < 5; turn += 1) {
    await click(document.body);
  }
};
const phase = () => (root.hidden ? 'none' : root.dataset.phase);
const button = (action) => root.querySelector(`[data-action="${action}"]`);
const buttons = () => [...root.querySelectorAll('button')].map(({ dataset }) => dataset.action);
const blocked = () => [...root.querySelectorAll('button')].filter(({ disabled }) => disabled).map(
  ({ dataset, title }) => [dataset.action, title]);
const orders = () => server.take().map(({ type, action }) => `${type} ${action}`);
const head = () => [textOf(root.querySelector('h2')), textOf(root.querySelector('.outcome-why'))];
const lines = () => [...root.querySelectorAll('table tr')].map((line) => textOf(line));
const links = () => [...root.querySelectorAll('.outcome-files a')].map(
  (node) => [node.textContent, node.getAttribute('href'), node.hasAttribute('download')]);
const score = () => textOf(root.querySelector('.score'));

for (const [reason, more, title, text] of [
  ['duration', {}, 'The run is over', 'Its duration of 30.0 s is over.'],
  ['stop', {}, 'The run is over', 'It was stopped by hand after 30.0 s.'],
  ['signal', {}, 'The run is over', 'It was ended at the terminal after 30.0 s.'],
  ['silence', {}, 'The simulation is silent',
    'It was heard last at 30.0 s. The terminal may tell why.'],
  ['drivability of hv0', { contacts: [{ ...HIT, with: 'x' }, HIT] }, 'Collision',
    'hv0 and av0 touched after 30.0 s, which ends this game.'],
  ['drivability of av0', { contacts: [HIT] }, 'Collision',
    'av0 and hv0 touched after 30.0 s, which ends this game.'],
  ['drivability of av0', {}, 'Off the road', 'av0 left the road after 30.0 s, which ends this '
    + 'game.'],
  ['a new reason', {}, 'The run is over', 'It ended after 30.0 s.'],
  [undefined, {}, 'The run is over', 'It ended after 30.0 s.'],
]) {
  test(`the end by ${reason} is: ${title}: ${text}`, () => {
    end(reason, more);
    assert.deepEqual(head(), [title, text]);
  });
}

test('contacts, departures and planners are told', () => {
  end('duration', { contacts: [HIT], departures: [{ vehicle: 'av0', t: 7 }],
    planners: { av0: PLANNER } });
  assert.deepEqual(lines(), ['Contacts hv0 with av0 at 4.2 s', 'Off the road av0 at 7.0 s',
    'av0 · mine.py:Mine 1 plan accepted, 2 refused, 1 fallback']);
  end('duration', { contacts: [], departures: [], planners: {} });
  assert.deepEqual(lines(), ['Contacts none', 'Off the road none',
    'av0 · idm 0 plans accepted, 0 refused, 0 fallbacks']);
});

test('of more than five contacts the others are counted', () => {
  const contacts = [1, 2, 3, 4, 5, 6].map((t) => ({ ...HIT, t }));
  end('duration', { contacts });
  assert.match(lines()[0], /hv0 with av0 at 5\.0 s; 1 more$/);
  end('duration', { contacts: contacts.slice(1) });
  assert.match(lines()[0], /hv0 with av0 at 6\.0 s$/);
});

test('the report names the side of a contact and who could have avoided it', () => {
  end('duration', { contacts: [HIT] });
  files({ contacts: [{ vehicle: 'av0', with: 'hv0', side: 'front', avoidable_by: 'av0' }] });
  assert.equal(lines()[0],
    'Contacts hv0 with av0 at 4.2 s (front of av0; could have avoided it: av0)');
});

test('a game of traffic alone has driven no vehicle', () => {
  const play = (vehicles) => store.receive({ type: 'scene', vehicles, objects: [], events: [],
    time: { epoch: 0, dt_s: 0.01, dt_c_s: 0.1 } });
  play([]);
  end('duration');
  assert.deepEqual(lines(), ['Driven no vehicle: traffic was alone']);
  play([VEHICLES[0]]);
  assert.deepEqual(lines(), ['Contacts none', 'Off the road none']);
});

test('names of planners and the words of a report stay text', () => {
  end('duration', { contacts: [HIT],
    planners: { av0: { ...PLANNER, planner: '<b>\u202emine</b>' } } });
  files({ contacts: [{ ...HIT, side: '<i>left</i>', avoidable_by: '\u202eboth' }] });
  assert.match(lines()[0],
    /\(<i>left<\/i> of hv0; could have avoided it: \u2068\u202eboth\u2069\)$/);
  assert.match(lines()[2], /^av0 · \u2068<b>\u202emine<\/b>\u2069 1 plan accepted/);
  assert.equal(root.querySelector('b, i'), null);
});

test('how the run kept time is told, if it was measured', () => {
  end('duration');
  assert.equal(root.querySelector('dl'), null);
  end('duration', { timing: { final_error_ms: 1.5, timeout_ratio: 0.01 } });
  const told = [...root.querySelectorAll('dl div')].map((line) => textOf(line));
  assert.deepEqual([told[0], told[1], told[3]],
    ['Lag at the end 1.50 ms', 'Mean step error – ms', 'Cycles over budget 1.00 %']);
});

test('the files of the run can be read and downloaded', () => {
  end('duration');
  assert.equal(root.querySelector('.outcome-files'), null);
  files();
  const file = (name) => `/api/runs/file?id=run%2F2%20a&file=${name}`;
  assert.match(textOf(root), /Files in run\/run_2/);
  assert.deepEqual(links(), [['Report', file('report.html'), false],
    ['Replay of the whole run', '/replay/run%2F2%20a/', false],
    ['game.yaml', file('game.yaml'), true], ['timing.json', file('timing.json'), true],
    ['Everything as ZIP', '/api/runs/zip?id=run%2F2%20a', true]]);
  assert.doesNotMatch(textOf(root), /are being written/);
});

test('what is still being written is not offered', () => {
  end('duration', { recording: { state: 'recording' } });
  files({ complete: false, names: ['game.yaml'] });
  assert.deepEqual(links().map(([name]) => name), ['game.yaml']);
  assert.match(textOf(root), /Scenario, timing report and report are being written …/);
  assert.equal(root.querySelector('.outcome-files[data-complete]'), null);
  assert.deepEqual([score(), asked], ['Scoring the run …', []]);
});

test('files of an earlier run are not those of this one', () => {
  files();
  end('duration', { epoch: 1 });
  assert.equal(root.querySelector('.outcome-files'), null);
});

test('without a server the files are only named', () => {
  end('duration');
  files();
  store.setConnected(false);
  assert.deepEqual([links(), [...root.querySelectorAll('.outcome-files li')].map(
    (item) => item.textContent)], [[], FILES.names]);
});

test('a recording that failed says why, as text', () => {
  end('duration', { recording: { state: 'failed', text: 'the disk\nis <b>full</b>' } });
  files();
  assert.equal(root.querySelector('.field-error').textContent, 'the disk is <b>full</b>');
  assert.deepEqual([root.querySelector('b'), links()], [null, []]);
});

test('the score is asked for once, and the own vehicle comes first, then people', async () => {
  answer = { refusal: '', vehicles: [SCORED('av0', 'autonomous', 0.987),
    SCORED('hv1', 'human', null), SCORED('hv0', 'human', 0.5)] };
  store.receive({ type: 'seats', seats: { hv0: { holder: 'c1' }, av0: { holder: null } } });
  end('duration');
  assert.equal(score(), 'Scoring the run …');
  files();
  await settle();
  status({ clients: 2, contacts: [HIT] });
  await settle();
  assert.deepEqual(asked, ['/api/runs/score?id=run%2F2%20a']);
  const shown = [...root.querySelectorAll('.score-vehicle')];
  assert.deepEqual(shown.map((node) => [node.dataset.vehicle, node.open,
    node.querySelector('.score-points').textContent]),
  [['hv0', true, '50'], ['hv1', false, '–'], ['av0', false, '99']]);
  assert.equal(textOf(shown[0]),
    'hv0 50 of 100 123 m, up to 36 km/h Progress 50 % No collision –');
  assert.match(textOf(shown[1]), /^hv1 – it never moved 123 m/);
  assert.deepEqual([...shown[0].querySelectorAll('li')].map(({ title }) => title),
    ['along the route; weight 5', 'at fault; multiplies the rest']);
});

test('a run without a score says why', async () => {
  end('duration', { recording: { state: 'none' } });
  assert.equal(score(), 'No score: nothing was recorded');
  status({ recording: { state: 'recorded' } });
  answer = { vehicles: [], refusal: 'it is too short' };
  files();
  await settle();
  assert.equal(score(), 'No score: it is too short');
  answer = { vehicles: [], refusal: '' };
  files({ run: 'second' });
  await settle();
  assert.equal(score(), 'No score: no vehicle was driven');
  answer = { error: 'the recording\nis <b>broken</b>' };
  files({ run: 'third' });
  await settle();
  assert.equal(score(), 'No score: the recording is <b>broken</b>');
  assert.equal(asked.length, 3);
});

test('a score that a silent server did not give is asked for by a new connection', async () => {
  answer = null;
  end('duration');
  files();
  await settle();
  store.setConnected(false);
  await settle();
  assert.equal(score(), 'No score: The server does not answer.');
  answer = { vehicles: [], refusal: 'it is too short' };
  store.setConnected(true);
  await settle();
  assert.equal(score(), 'No score: it is too short');
  assert.equal(asked.length, 2);
});

test('the card of a run that is over leads to the next one', async () => {
  status({ run: 'ended', reason: 'duration', t: 30 });
  assert.equal(phase(), 'over');
  assert.deepEqual(buttons(), ['close', 'again', 'next', 'another', 'look']);
  for (const action of ['again', 'next', 'another', 'look']) {
    await click(button(action));
  }
  assert.deepEqual([orders(), did], [['control reset'], ['next', 'choose', 'look']]);
  status({ run: 'running', epoch: 1, n: 1 });
  assert.equal(phase(), 'none');
});

test('the end by a reset is no result', () => {
  status({ run: 'ended', reason: 'reset' });
  assert.equal(phase(), 'none');
});

test('a closed card can be opened again, and the next run has its own', async () => {
  status({ run: 'ended', reason: 'duration' });
  await click(button('close'));
  assert.deepEqual([phase(), textOf(root)], ['closed', 'How it went']);
  await click(button('reopen'));
  assert.equal(phase(), 'over');
  await click(button('close'));
  status({ epoch: 1 });
  assert.equal(phase(), 'over');
});

test('another program begins with the same epoch, and its card is open', async () => {
  const hello = (program) => store.receive({ type: 'hello', client: 'c7', name: 'Ada',
    mode: 'live', version: '1', rights: store.rights, program });
  hello('first');
  end('duration');
  files({ epoch: 0 });
  await click(button('close'));
  hello('first');
  assert.equal(phase(), 'closed', 'the same one, connected again');
  hello('second');
  assert.equal(phase(), 'over');
  assert.deepEqual(links(), [], 'files of the first one');
});

test('when the program has ended the card stays and says so', () => {
  status({ run: 'ended', reason: 'duration' });
  store.setConnected(false);
  const gone = 'There is no connection to the simulation.';
  assert.deepEqual(blocked(), [['again', gone], ['next', gone], ['another', gone]]);
  assert.match(textOf(root), /The simulation program has ended\. This page shows its last state/);
});

test('a program that ends with its run says so before it does', () => {
  status({ run: 'ended', reason: 'duration', stays: false });
  assert.deepEqual(blocked()[0], ['again', 'The program ends with this run.']);
  assert.match(textOf(root), /The program ends with this run\./);
});

test('a card that is the same is not built again, and the focus stays on its button', () => {
  status({ run: 'ended', reason: 'duration' });
  const before = button('again');
  status({});
  assert.equal(button('again'), before);
  before.focus();
  status({ contacts: [HIT] });
  assert.notEqual(button('again'), before);
  assert.equal(document.activeElement, button('again'));
});

test('a pressed button gives the focus back: the space bar brakes', async () => {
  status({ run: 'ended', reason: 'duration' });
  button('again').focus();
  await click(button('again'));
  assert.notEqual(document.activeElement, button('again'));
});
