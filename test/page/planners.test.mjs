// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The table of planners: their figures and states, and the switch beside each. */

import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { createPlanners } from '../../page/cockpit/js/panels/planners.js';
import { click, liveStore, openPage, RIGHTS, Server, textOf } from './dom_support.mjs';

const VEHICLES = [{ id: 'hv0', role: 'human' }, { id: 'av0', role: 'autonomous' },
  { id: 'av1', role: 'autonomous' }];
const GOOD = { running: true, stale: false, latency_ms: 12.4, age_ms: 87.6, accepted: 12345,
  refused: 2, plan_time_ms: 8.25, fallbacks: 1, planner: 'idm', last_refusal: '',
  tracking: null };

let root, server, store;

beforeEach(() => {
  openPage('<section id="panel-timing"></section>');
  root = document.getElementById('panel-timing');
  globalThis.window.crgame = { world: { followed: null } };
  server = new Server();
  store = liveStore(VEHICLES, { planners: { av0: 'idm', av1: '/home/x/mine.py:Mine' } });
  createPlanners(root, store, server);
});

const show = (av0, av1) => store.receive({ type: 'status', run: 'running', n: 1, t: 0.1,
  epoch: 0, planners: { ...(av0 && { av0 }), ...(av1 && { av1 }) } });
const row = (av) => root.querySelector(`tbody[data-av="${av}"]`);
const tag = (av) => row(av).querySelector('.tag');
const part = (av, name) => row(av).querySelector(name).textContent;
const button = (av) => row(av).querySelector('.planner-switch');
const figures = (av) => [...row(av).lastChild.children].slice(1).map((cell) => cell.textContent);

test('each AV has a row with the name and the figures of its planner, in order', () => {
  show(GOOD, { ...GOOD, latency_ms: null, age_ms: null, fallbacks: null, planner: '' });
  assert.deepEqual([...root.querySelectorAll('tbody')].map(({ dataset }) => dataset.av),
    ['av0', 'av1']);
  assert.deepEqual([...root.querySelectorAll('th')].map(({ textContent }) => textContent),
    ['AV', 'Latencyms', 'Agems', 'Accepted', 'Refused', 'Fallbacks']);
  assert.deepEqual(figures('av0'), ['12', '88', '12\u202f345', '2', '1']);
  assert.deepEqual(figures('av1'), ['–', '–', '12\u202f345', '2', '–']);
  assert.deepEqual([part('av0', '.planner-name'), part('av1', '.planner-name')],
    ['idm', 'mine.py:Mine']);
});

test('before the first figures there are none, and a game may have no AV', () => {
  assert.deepEqual(figures('av0'), ['–', '–', '–', '–', '–']);
  assert.equal(part('av0', '.planner-name'), 'idm');
  assert.doesNotMatch(textOf(root), /No autonomous vehicle/);
  store.receive({ type: 'scene', time: { epoch: 1, dt_s: 0.01, dt_c_s: 0.1 },
    vehicles: [VEHICLES[0]], objects: [], events: [] });
  assert.equal(textOf(root), 'Planners No autonomous vehicle takes part.');
  store.receive({ type: 'scene', time: { epoch: 2, dt_s: 0.01, dt_c_s: 0.1 },
    vehicles: VEHICLES.slice(0, 2), objects: [], events: [] });
  assert.equal(root.querySelectorAll('tbody').length, 1);
  assert.doesNotMatch(textOf(root), /No autonomous vehicle/);
});

test('the planner that drives now is named, not the one of the game', () => {
  show({ ...GOOD, planner: '/opt/other.py:Other' });
  assert.equal(part('av0', '.planner-name'), 'other.py:Other');
});

test('a stale plan is marked at its age, but not of a stopped planner', () => {
  const late = () => row('av0').querySelectorAll('[data-late]').length;
  show({ ...GOOD, stale: true });
  assert.deepEqual([tag('av0').textContent, tag('av0').dataset.state], ['stale', 'stale']);
  assert.ok(row('av0').lastChild.children[2].hasAttribute('data-late'));
  assert.equal(late(), 1);
  show({ ...GOOD, stale: true, running: false });
  assert.deepEqual([tag('av0').textContent, late()], ['stopped', 0]);
  show(GOOD);
  assert.deepEqual([tag('av0').textContent, late()], ['running', 0]);
});

test('the switch stops a planner, and lets a stopped one go on', async () => {
  show(GOOD, { ...GOOD, running: false });
  assert.deepEqual(['av0', 'av1'].map((av) => [button(av).textContent,
    button(av).getAttribute('aria-label')]), [['Stop', 'Stop the planner of av0'],
    ['Go', 'Let the planner of av1 go on']]);
  await click(button('av0'));
  await click(button('av1'));
  assert.deepEqual(server.take(), [{ type: 'planner', av: 'av0', run: false },
    { type: 'planner', av: 'av1', run: true }]);
  show({ ...GOOD, running: false }, GOOD);
  assert.deepEqual([button('av0').textContent, button('av1').textContent], ['Go', 'Stop']);
});

test('the switch waits for the answer, and a refusal is said in the row', async () => {
  show(GOOD, GOOD);
  let answer;
  server.request = (message) => {
    server.requests.push(message);
    return new Promise((resolve) => {
      answer = resolve;
    });
  };
  await click(button('av0'));
  assert.ok(button('av0').disabled);
  show(GOOD, GOOD);
  assert.ok(button('av0').disabled, 'a status comes before the answer');
  await click(button('av0'));
  assert.equal(server.take().length, 1);
  answer({ ok: false, text: 'av0 is driven\nby <b>Bob</b>' });
  await click(document.body);
  assert.equal(part('av0', '[role=alert]'), 'av0 is driven by <b>Bob</b>');
  assert.deepEqual([part('av1', '[role=alert]'), root.querySelector('b')], ['', null]);
  assert.ok(!button('av0').disabled);
  await click(button('av0'));
  answer({ ok: true, text: '' });
  await click(document.body);
  assert.equal(part('av0', '[role=alert]'), '');
});

test('who does not direct is told why, and asks nothing of the server', async () => {
  store.receive({ type: 'you', rights: RIGHTS.watch, accepted: true });
  show(GOOD);
  assert.equal(button('av0').title, 'Only a director can stop planners; you are a spectator.');
  await click(button('av0'));
  assert.deepEqual(server.take(), []);
  store.receive({ type: 'you', accepted: true,
    rights: { ...RIGHTS.watch, role: 'director', directs: true } });
  show(GOOD);
  assert.equal(button('av0').title, 'Stop the planner of av0');
  await click(button('av0'));
  assert.equal(server.take().length, 1);
});

test('a recording has no switches', () => {
  store.receive({ type: 'hello', client: 'c1', name: 'Ada', mode: 'replay', version: '1' });
  show(GOOD, GOOD);
  assert.doesNotMatch(textOf(root), /Stop|Go/);
  assert.equal(tag('av0').textContent, 'running');
});

test('the time of a plan and the last refusal are told, if there are any', () => {
  show(GOOD, { ...GOOD, plan_time_ms: null, last_refusal: 'too fast:\n<b>31 m/s</b>' });
  assert.equal(part('av0', '.refusal'), 'plans in 8.3 ms');
  assert.equal(part('av1', '.refusal'), 'last refused: too fast: <b>31 m/s</b>');
  assert.equal(root.querySelector('b'), null);
  show({ ...GOOD, last_refusal: 'late' }, { ...GOOD, plan_time_ms: 0 });
  assert.equal(part('av0', '.refusal'), 'plans in 8.3 ms, last refused: late');
  assert.equal(part('av1', '.refusal'), '');
});

test('errors of tracking are told with the worst of the run, headings in degrees', () => {
  // 0.01 rad are 0.57°, and 0.1 rad are 5.73°.
  show({ ...GOOD, tracking: { lane_error: 0.123, worst_lane_error: 0.5, lateral_error: -0.2,
    worst_lateral_error: 0.25, along_error: null, worst_along_error: 1.5, heading_error: 0.01,
    worst_heading_error: 0.1, speed_error: -0.004, worst_speed_error: 2 } }, GOOD);
  assert.equal(part('av0', '.tracking'), 'off its lane and plan: lane 0.12 m (0.50), '
    + 'lateral −0.20 m (0.25), along – m (1.50), heading 0.6 ° (5.7), speed 0.00 m/s (2.00)');
  assert.equal(part('av1', '.tracking'), '');
});

test('the AV that is followed says how much it sees', () => {
  globalThis.window.crgame = { world: { followed: 'av1' },
    perception: { count: { seen: 3, near: 4, range: 80 } } };
  show(GOOD, GOOD);
  assert.deepEqual([part('av0', '.seen'), part('av1', '.seen')], ['', 'sees 3 of 4 within 80 m']);
  globalThis.window.crgame.perception = undefined;
  show(GOOD, GOOD);
  assert.equal(part('av1', '.seen'), '');
});

test('nothing is written while the panel is hidden, and all when it is shown', async () => {
  root.hidden = true;
  show(GOOD, GOOD);
  assert.deepEqual(figures('av0'), ['–', '–', '–', '–', '–']);
  root.hidden = false;
  await globalThis.window.happyDOM.waitUntilComplete();
  assert.deepEqual(figures('av0'), ['12', '88', '12\u202f345', '2', '1']);
});

test('names of planners stay text', () => {
  const planner = `<b>${'p'.repeat(3000)}<i>`;
  show({ ...GOOD, planner });
  assert.equal(part('av0', '.planner-name'), planner);
  assert.equal(root.querySelector('b, i'), null);
});
