// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The bar of a recording: its buttons, keys, slider, events, runs, and the shown time. */

import assert from 'node:assert/strict';
import { setImmediate as soon } from 'node:timers/promises';
import { beforeEach, test } from 'node:test';

import { mark } from '../../page/cockpit/js/replay/marks.js';
import { Player } from '../../page/cockpit/js/replay/player.js';
import { Store } from '../../page/cockpit/js/store.js';
import { click, openPage, Pictures, send, textOf } from './dom_support.mjs';
import { close, stateFrame } from './support.mjs';

const event = (kind, n, more) => ({ t: n / 100, until_t: n / 100, n, k: Math.floor(n / 10), kind,
  subject: '', text: '', count: 1, ...more });
const EVENTS = [event('collision', 453, { subject: 'hv0', text: 'with <b>o1</b>' }),
  event('refused_plan', 610, { subject: 'av0', count: 3 }), event('some_news', 800)];
const INFO = { epoch: 0, epochs: [0, 2], start_s: 0, end_s: 9.99, chunk_s: 5, chunks: 2,
  dt_s: 0.01, steps_per_tick: 10, k0: 100, first_n: 0, last_n: 999, documents: {}, notices: [],
  events: EVENTS, scene: { vehicles: [{ id: 'hv0' }], objects: [], lanelets: [],
    time: { epoch: 0, dt_s: 0.01, dt_c_s: 0.1 } } };

let root, store, pictures, player, asked, answers;

beforeEach(() => {
  openPage('<footer id="timeline" hidden></footer>');
  root = document.querySelector('#timeline');
  pictures = new Pictures();
  [asked, answers] = [[], { info: () => Response.json(INFO), chunk }];
  globalThis.fetch = async (address) => {
    const { pathname, searchParams } = new URL(address, 'http://host');
    asked.push(address);
    return (answers[pathname.split('/').at(-1)] ?? (() => new Response('')))(searchParams);
  };
  store = new Store();
  player = new Player(root, store);
});

/** Answer with a chunk of 5 s: the states of one vehicle with x = n. */
function chunk(query) {
  const first = 500 * Number(query.get('i'));
  const frames = Array.from({ length: 500 }, (_, i) => new Uint8Array(stateFrame(
    { epoch: Number(query.get('epoch')), n: first + i, t: (first + i) / 100 }, [first + i])));
  return new Response(new Blob(frames.flatMap(
    (bytes) => [new Uint8Array(new Uint32Array([bytes.length]).buffer), bytes])));
}

/** Say that the page shows a recording, and wait until its first picture is there. */
async function begin(info = {}) {
  answers.info = () => Response.json({ ...INFO, ...info });
  store.receive({ type: 'hello', client: 'c1', name: 'Ada', mode: 'replay', version: '1' });
  await settled();
}

/** Draw pictures until nothing is being loaded. */
async function settled() {
  for (let i = 0; i < 100 && (player.info === null || player.loading || i < 3); i += 1) {
    await soon();
  }
  pictures.draw(0);
}

const find = (selector) => root.querySelector(selector);
const action = (name) => find(`[data-action="${name}"]`);
const slider = () => find('input[type=range]');
const key = (name, more) => send(document.body, 'keydown', { key: name, ...more });
const told = () => find('.timeline-event').textContent;
const choose = (select, value) => {
  select.focus();
  select.value = value;
  send(select, 'change');
  assert.ok(document.activeElement !== select, 'the keys are those of the bar again');
};

test('the bar appears for a recording alone', async () => {
  store.receive({ type: 'hello', client: 'c1', name: 'Ada', mode: 'live', version: '1' });
  await soon();
  assert.deepEqual([root.hidden, asked], [true, []]);
  assert.ok(!key(' ').defaultPrevented);
  await begin();
  assert.equal(root.hidden, false);
  assert.deepEqual([slider().min, slider().max, slider().value], ['0', '999', '0']);
  assert.equal(find('output').textContent, '0.00 / 9.99 s   k 100');
  assert.equal(asked.filter((address) => address.includes('info')).length, 1);
});

test('keys and buttons step from tick to tick, and stop at the ends', async () => {
  await begin();
  await player.seek(4.837);
  const steps = [() => key('.'), () => key('.'), () => key(','), () => key('ArrowRight'),
    () => key('ArrowLeft'), () => action('back').click(), () => action('on').click()];
  const seen = [];
  for (const step of steps) {
    step();
    await settled();
    seen.push(player.n);
  }
  assert.deepEqual(seen, [490, 500, 490, 500, 490, 480, 490]);
  assert.equal(find('output').textContent, '4.90 / 9.99 s   k 149');
  assert.equal(slider().getAttribute('aria-valuetext'), '4.90 seconds, step 149');
  assert.equal(slider().value, '490');
  close(store.displayed(pictures.now_ms).vehicles[0], 490);
  await player.seek(99);
  key('.');
  await settled();
  assert.equal(player.n, 990, 'the last tick');
  await player.seek(0);
  key(',');
  await settled();
  assert.equal(player.n, 0);
});

test('the space bar plays and pauses; the time moves at the chosen speed', async () => {
  await begin();
  const speeds = find('select[aria-label^="Speed"]');
  assert.equal(speeds.value, '1');
  assert.deepEqual([action('play').title, store.status.run], ['Play (Space)', 'paused']);
  key(' ');
  pictures.draw(100);
  assert.deepEqual([action('pause').title, store.status.run], ['Pause (Space)', 'running']);
  close(player.t, 0.1);
  choose(speeds, '8');
  pictures.draw(100);
  close(player.t, 0.9);
  choose(speeds, '0.1');
  pictures.draw(100);
  close(player.t, 0.91);
  await click(action('pause'));
  pictures.draw(100);
  close(player.t, 0.91);
  assert.equal(action('play').getAttribute('aria-label'), 'Play');
});

test('a stall of the page is not caught up, and no speed is beyond its limits', async () => {
  await begin();
  player.play();
  pictures.draw(60_000);
  close(player.t, 0.25);
  player.speed = 1000;
  assert.equal(player.speed, 8);
  player.speed = 0;
  assert.equal(player.speed, 0.1);
});

test('at the end it stands still, and playing begins anew', async () => {
  await begin();
  await player.seek(9.9);
  player.play();
  pictures.draw(200);
  pictures.draw();
  assert.deepEqual([player.playing, player.t, store.status.run], [false, 9.99, 'ended']);
  key(' ');
  await settled();
  assert.ok(player.playing);
  assert.ok(player.t < 1);
});

test('a time is not shown before its data has come', async () => {
  await begin({ chunks: 100, end_s: 499.99, last_n: 49_999 });
  let release;
  const held = new Promise((resolve) => { release = resolve; });
  answers.chunk = async (query) => { await held; return chunk(query); };
  player.seek(400);
  pictures.draw();
  assert.deepEqual([player.loading, root.hasAttribute('data-loading')], [true, true]);
  assert.equal(store.displayed(pictures.now_ms).t, 0, 'the former picture');
  assert.equal(find('output').textContent, '400.00 / 499.99 s   k 4100', 'the wanted time');
  release();
  await settled();
  assert.deepEqual([player.loading, root.hasAttribute('data-loading')], [false, false]);
  close(store.displayed(pictures.now_ms).vehicles[0], 40_000);
});

test('while playing, the time waits for data that is late', async () => {
  let release;
  const held = new Promise((resolve) => { release = resolve; });
  answers.chunk = async (query) => {
    await (Number(query.get('i')) > 2 ? held : null);
    return chunk(query);
  };
  await begin({ chunks: 100, end_s: 499.99, last_n: 49_999 });
  await player.seek(14.95);
  player.play();
  pictures.draw(100);
  pictures.draw(100);
  assert.deepEqual([player.t, player.playing], [14.95, true]);
  release();
  await settled();
  pictures.draw(100);
  close(player.t, 15.05);
});

test('after a jump the plots are told of the past once', async () => {
  await begin({ documents: { timing: [[1, {}], [2, {}], [7, {}]] } });
  await player.seek(5);
  const told_s = [];
  store.on('status', ({ t: time }) => told_s.push(time));
  pictures.draw(301);
  assert.deepEqual(told_s.splice(0).slice(-3), [1, 2, 5]);
  pictures.draw(50);
  pictures.draw(50);
  assert.deepEqual(told_s, []);
});

test('brackets lead from event to event and tell of it', async () => {
  await begin();
  const way = [];
  for (const name of [']', ']', ']', ']', '[', '[', '[']) {
    key(name);
    await settled();
    way.push(player.n);
  }
  assert.deepEqual(way, [453, 610, 800, 800, 610, 453, 453]);
  assert.equal(told(), '4.53 s  Collision (hv0): with <b>o1</b>');
  assert.ok(!root.querySelector('b'));
  await click(action('next'));
  assert.equal(told(), '6.10 s  Plan refused (av0), 3 times');
  await click(action('previous'));
  assert.match(told(), /^4\.53 s/);
});

test('each event has its mark, which is clicked', async () => {
  await begin();
  const marks = [...root.querySelectorAll('.mark')];
  assert.deepEqual(marks.map(({ dataset, title }) => [dataset.kind, title]), [
    ['collision', '4.53 s  Collision (hv0): with <b>o1</b>'],
    ['refused_plan', '6.10 s  Plan refused (av0), 3 times'],
    ['some_news', '8.00 s  some news']]);
  assert.equal(new Set(marks.map((node) => node.querySelector('path').getAttribute('d'))).size, 3);
  close(marks.map(({ style }) => Number(style.getPropertyValue('--share'))),
    [0.453, 0.61, 0.8], 1e-3);
  await click(marks[1]);
  await settled();
  assert.deepEqual([player.n, told()], [610, '6.10 s  Plan refused (av0), 3 times']);
  assert.ok(marks.every(({ tabIndex }) => tabIndex === -1));
  let chosen = 0;
  mark(EVENTS[0], 0, () => { chosen += 1; }).click();
  assert.equal(chosen, 1);
});

test('a run without events says so', async () => {
  await begin({ events: [] });
  assert.equal(told(), 'No events in this run');
  key(']');
  assert.equal(player.n, 0);
});

test('the slider is dragged, and steered by its own keys', async () => {
  await begin();
  slider().value = '321';
  send(slider(), 'input');
  await settled();
  assert.equal(player.n, 321);
  const way = [];
  for (const name of ['ArrowUp', 'ArrowRight', 'ArrowDown', 'ArrowLeft', 'PageUp', 'PageDown',
    'End', 'Home']) {
    assert.ok(send(slider(), 'keydown', { key: name }).defaultPrevented);
    await settled();
    way.push(player.n);
  }
  // One step each, not a second one for the key of the page.
  assert.deepEqual(way, [330, 340, 330, 320, 820, 320, 999, 0]);
  send(slider(), 'keydown', { key: ' ' });
  assert.ok(player.playing, 'the space bar plays at the slider too');
});

test('keys that belong to others are left to them', async () => {
  await begin();
  const extra = document.createElement('div');
  document.body.append(extra);
  const at = (tag, role) => {
    const node = document.createElement(tag);
    node.setAttribute('role', role ?? '');
    extra.append(node);
    return node;
  };
  const untaken = [[at('input'), '.'], [at('textarea'), ' '], [at('select'), 'ArrowLeft'],
    [at('button'), ' '], [at('button', 'tab'), 'ArrowRight'], [at('a'), ' ']];
  for (const [node, name] of untaken) {
    assert.ok(!send(node, 'keydown', { key: name }).defaultPrevented, `${node.tagName} ${name}`);
  }
  for (const more of [{ ctrlKey: true }, { metaKey: true }, { altKey: true }]) {
    assert.ok(!key('.', more).defaultPrevented);
  }
  assert.ok(send(at('button'), 'keydown', { key: '.' }).defaultPrevented);
  await settled();
  assert.equal(player.n, 10);
  extra.append(document.createElement('dialog'));
  extra.lastChild.setAttribute('open', '');
  assert.ok(!key('.').defaultPrevented);
});

test('another run of the recording is chosen from the list', async () => {
  await begin();
  const runs = find('select[aria-label="Run"]');
  assert.deepEqual([...runs.options].map(({ text }) => text), ['1 of 2', '2 of 2']);
  const scene = { ...INFO.scene, title: 'Another', time: { ...INFO.scene.time, epoch: 2 } };
  await player.seek(3);
  answers.info = () => Response.json({ ...INFO, epoch: 2, scene });
  choose(runs, '2');
  await settled();
  assert.ok(asked.includes('api/replay/info?epoch=2'));
  assert.deepEqual([player.info.epoch, store.epoch, store.scene.title, player.t],
    [2, 2, 'Another', 0]);
  // After a lost connection, the server begins with the scene of its first run.
  store.receive({ type: 'scene', ...INFO.scene });
  assert.equal(store.scene.title, 'Another');
  assert.equal(runs.value, '2');
});

test('a recording of one run has no list of runs, and its notices are shown', async () => {
  const notices = [];
  store.on('notice', ({ level, text }) => notices.push([level, text]));
  await begin({ epochs: [0], notices: ['<i>3 states are missing</i>'] });
  assert.doesNotMatch(textOf(root), /Run/);
  assert.deepEqual(notices, [['warn', '<i>3 states are missing</i>']]);
});

test('what cannot be loaded is said once, and asked for again with the next connection',
  async () => {
    const notices = [];
    store.on('notice', ({ text }) => notices.push(text));
    answers.info = () => Response.json({ error: 'the bag is broken' }, { status: 404 });
    const hello = { type: 'hello', client: 'c1', name: 'Ada', mode: 'replay', version: '1' };
    store.receive(hello);
    store.receive(hello);
    for (let i = 0; i < 5; i += 1) {
      await soon();
    }
    assert.equal(asked.length, 1, 'not twice at once');
    store.setConnected(true);
    for (let i = 0; i < 5; i += 1) {
      await soon();
    }
    assert.deepEqual([notices, asked.length, root.hidden], [['the bag is broken'], 2, true]);
    player.toggle();
    assert.equal(player.playing, false);
    await begin();
    assert.ok(!root.hidden);
  });
