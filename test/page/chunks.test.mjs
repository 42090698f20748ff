// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A recorded run: its chunks, and the frames and documents that are valid at a time. */

import assert from 'node:assert/strict';
import { setImmediate as soon } from 'node:timers/promises';
import { test } from 'node:test';

import { KIND } from '../../page/cockpit/js/frames.js';
import { ask, Chunks, unpack } from '../../page/cockpit/js/replay/chunks.js';
import { ReplayDocuments } from '../../page/cockpit/js/replay/documents.js';
import { ReplayFeed } from '../../page/cockpit/js/replay/replay_feed.js';
import { Store } from '../../page/cockpit/js/store.js';
import { close, frameOf, stateFrame } from './support.mjs';

/** Pack frames as the server does: each after its length in bytes. */
function packed(...frames) {
  const size = frames.reduce((sum, frame) => sum + 4 + frame.byteLength, 0);
  const bytes = new Uint8Array(size);
  let at = 0;
  for (const frame of frames) {
    new DataView(bytes.buffer).setUint32(at, frame.byteLength, true);
    bytes.set(new Uint8Array(frame), at + 4);
    at += 4 + frame.byteLength;
  }
  return bytes.buffer;
}

/** Answer the page's fetches; return the list of requested addresses. */
function serve(t, answer) {
  const asked = [];
  t.mock.method(globalThis, 'fetch', async (address) => {
    const url = new URL(address, 'http://host');
    asked.push(`${url.pathname}${url.search}`);
    return answer(url);
  });
  return asked;
}

const INFO = { epoch: 3, start_s: 0.5, chunk_s: 5, chunks: 100, dt_s: 0.01, steps_per_tick: 10,
  k0: 0, first_n: 50, last_n: 50_000, end_s: 500, documents: {} };

test('frames are unpacked as they were packed', () => {
  const frames = [frameOf(1, 2, 3), frameOf(), frameOf(4)];
  const [one, none, other] = unpack(packed(...frames)).map((buffer) => new Float64Array(buffer));
  close(one, [1, 2, 3]);
  assert.equal(none.length, 0);
  close(other, [4]);
  assert.deepEqual(unpack(new ArrayBuffer(0)), []);
});

test('the chunk that holds a time', () => {
  const chunks = new Chunks(INFO, () => {}, () => {});
  assert.deepEqual([-9, 0.5, 5.4999, 5.5, 10.49, 9999].map((t) => chunks.numberAt(t)),
    [0, 0, 0, 1, 1, 99]);
});

test('a refusal of the server becomes an error with its reason', async (t) => {
  const asked = serve(t, ({ pathname }) => (pathname.endsWith('info')
    ? Response.json({ error: 'there is no such epoch' }, { status: 404 })
    : new Response('<html>', { status: 500 })));
  await assert.rejects(ask('info', { epoch: 7 }), { message: 'there is no such epoch' });
  await assert.rejects(ask('chunk', {}), { message: 'The server answered 500.' });
  assert.deepEqual(asked, ['/api/replay/info?epoch=7', '/api/replay/chunk']);
});

test('wanted chunks are fetched once, and each frame counts from its time on', async (t) => {
  const plan = frameOf(KIND.PLAN, 3, 60, 6, 0.6, 2, 0);
  const scan = frameOf(KIND.SCAN, 3, 61, 6, 0.61, 1, 4);
  const asked = serve(t, () => new Response(packed(
    stateFrame({ epoch: 3, n: 65, t: 0.65 }), plan, scan)));
  let loaded = 0;
  const chunks = new Chunks(INFO, () => { loaded += 1; }, assert.fail);
  chunks.want(0, 1);
  chunks.want(0, 1);
  assert.equal(chunks.get(0), undefined);
  await soon();
  await soon();
  assert.deepEqual(asked, ['/api/replay/chunk?i=0&epoch=3', '/api/replay/chunk?i=1&epoch=3']);
  assert.deepEqual([loaded, chunks.size], [2, 2]);
  // A plan counts from the state after which it came; nothing counts before the first frame.
  assert.deepEqual(chunks.get(0).map(({ at, slot }) => [at, slot]),
    [[0.65, '1'], [0.65, '3:2'], [0.65, '5:1:4']]);
});

test('the twelve chunks used last are kept', async (t) => {
  const asked = serve(t, () => new Response(packed()));
  const chunks = new Chunks(INFO, () => {}, assert.fail);
  for (const number of [...Array(12).keys(), 0, 12]) {
    chunks.want(number, 0);
    await soon();
    await soon();
  }
  assert.equal(chunks.size, 12);
  assert.equal(asked.length, 13);
  assert.ok(chunks.get(0) !== undefined && chunks.get(1) === undefined);
});

test('a failed fetch is repeated after a second', async (t) => {
  let now_ms = 1000;
  t.mock.method(performance, 'now', () => now_ms);
  const asked = serve(t, () => Response.json({ error: 'damaged' }, { status: 404 }));
  const told = [];
  const chunks = new Chunks(INFO, assert.fail, ({ message }) => told.push(message));
  const want = async () => {
    chunks.want(0, 0);
    await soon();
    await soon();
  };
  await want();
  now_ms = 1999;
  await want();
  assert.deepEqual([asked.length, told], [1, ['damaged']]);
  now_ms = 2001;
  await want();
  assert.equal(asked.length, 2);
});

/** A run of 10 s, a state each 10 ms with x = 100 t; plans of vehicle 0 at 1 and 3 s. */
function recordedRun(t) {
  serve(t, (url) => {
    const chunk = Number(url.searchParams.get('i'));
    const frames = [];
    for (let n = 500 * chunk; n < 500 * (chunk + 1); n += 1) {
      frames.push(stateFrame({ epoch: 3, n, k: Math.floor(n / 10), t: n / 100 }, [n]));
      if (n === 100 || n === 300) {
        frames.push(frameOf(KIND.PLAN, 3, n, n / 10, n / 100, 0, 1, n, 0, 0, 0, 0));
      }
    }
    const outline = Array.from({ length: 200 }, (_, second) => stateFrame(
      { epoch: 3, n: 100 * second, t: second }, [0], [second]));
    return new Response(packed(...url.pathname.endsWith('outline') ? outline : frames));
  });
  const store = new Store();
  const info = { ...INFO, start_s: 0, chunks: 2, end_s: 9.99 };
  return { store, feed: new ReplayFeed(store, info, { loaded() {}, refused: assert.fail }) };
}

test('nothing is shown until the chunk has arrived, then exactly its time', async (t) => {
  const { store, feed } = recordedRun(t);
  assert.ok(Number.isNaN(feed.show(2)));
  await soon();
  await soon();
  assert.equal(feed.show(2), 2);
  store.useTimeSource(() => 2.004);
  // Between two states, the later of which has arrived too: x = 100 t.
  assert.equal(feed.show(2.004), 2.004);
  close(store.displayed(1).vehicles[0], 200.4, 1e-9);
});

test('after a jump only valid frames and half a second of states remain', async (t) => {
  const { store, feed } = recordedRun(t);
  feed.show(0);
  await soon();
  await soon();
  feed.show(4);
  assert.equal(store.plans.get(0).n, 300);
  const [first] = store.samples.toArray();
  close([first.t, store.latest.t], [3.51, 4.01], 1e-9);
  feed.show(2);
  assert.equal(store.plans.get(0).n, 100, 'of the past alone');
  close(store.latest.t, 2.01, 1e-9);
});

test('playing on gives all states across the border of two chunks', async (t) => {
  const { store, feed } = recordedRun(t);
  feed.show(4.9);
  await soon();
  await soon();
  const seen = new Set();
  store.on('state', ({ n }) => seen.add(n));
  for (let time = 4.9; time < 5.1; time += 0.016) {
    feed.show(time);
  }
  const expected = Array.from({ length: 18 }, (_, i) => 492 + i);
  assert.deepEqual(expected.filter((n) => !seen.has(n)), []);
});

test('the outline gives the past of a vehicle and the following minute', async (t) => {
  const { feed } = recordedRun(t);
  feed.show(5);
  await soon();
  await soon();
  feed.show(5);
  const past = feed.history(1, 3);
  assert.deepEqual([past.t[0], past.t.at(-1), past.t.length], [2, 65, 64]);
  assert.deepEqual(past.x, past.t);
});

function documentsOf(documents) {
  const store = new Store();
  const told = [];
  for (const kind of ['signals', 'events', 'seats', 'alarms', 'status']) {
    store.on(kind, (message) => told.push(message));
  }
  return { store, told, shown: new ReplayDocuments(store, { ...INFO, documents }) };
}

const now = (time, more) => (
  { t: time, n: Math.round(100 * time), k: 0, run: 'running', speed: 2, ...more });

test('the documents that are valid at a time, forward and back', () => {
  const { store, shown } = documentsOf({
    signals: [[1, { k: 10, states: { 5: 'red' }, objects: {} }],
      [2, { k: 20, states: { 5: 'green' }, objects: {} }]],
    frames_skipped: [[1.5, true]], timing: [[1, { final_error_ms: 7 }]],
  });
  const light = (time) => {
    shown.show(now(time), 0, true);
    return store.signals.states[5];
  };
  assert.deepEqual([0.5, 1, 1.99, 2, 1.2, 0].map(light),
    [undefined, 'red', 'red', 'green', 'red', undefined]);
  shown.show(now(1.6), 0, true);
  assert.deepEqual([store.status.frames_skipped, store.status.timing.final_error_ms],
    [true, 7]);
  shown.show(now(0.9), 0, true);
  assert.deepEqual([store.status.frames_skipped, store.status.timing], [false, null]);
});

test('each valid document is sent once, the status five times a second', () => {
  const { told, shown } = documentsOf({ signals: [[1, { k: 10, states: {}, objects: {} }]] });
  for (let now_ms = 0; now_ms <= 1000; now_ms += 20) {
    shown.show(now(1 + now_ms / 1000), now_ms, false);
  }
  const times = (kind) => told.filter(({ type }) => type === kind).length;
  assert.deepEqual(['signals', 'events', 'seats', 'alarms', 'status'].map(times),
    [1, 1, 1, 1, 6]);
  shown.show(now(2, { run: 'paused' }), 1001, false);
  assert.equal(times('status'), 7, 'that it stands still is told at once');
});

test('who drove a seat of a recorded run is known by name', () => {
  const driven = (holder_name) => ({ seats: {
    hv0: { source: 'cockpit', driver: 'cockpit', holder: null, holder_name } } });
  const { store, shown } = documentsOf({ seats: [[0, driven('Ada')], [2, driven('Bob')]] });
  assert.deepEqual([1, 2, 0].map((t) => {
    shown.show(now(t), 0, true);
    return store.seats.hv0.holder_name;
  }), ['Ada', 'Bob', 'Ada']);
});

test('after a jump the plots get the status of the last two minutes, then the present one',
  () => {
    const planners = [...Array(300).keys()].map((second) => [second, {}]);
    const { told, shown } = documentsOf({ planners });
    shown.replayStatus(now(200));
    const times = told.map(({ t }) => t);
    // After 80 s and before 200 s, one a second, and now.
    assert.deepEqual([times[0], times.at(-2), times.at(-1), times.length], [81, 199, 200, 120]);
  });

test('the status of a recording has its playback speed', () => {
  const { store, shown } = documentsOf({});
  shown.show(now(1), 0, true);
  assert.deepEqual([store.status.real_time_factor, store.status.measured_factor], [2, 2]);
  shown.show(now(1, { run: 'paused' }), 0, true);
  assert.deepEqual([store.status.measured_factor, store.status.recording.state], [null, 'none']);
});
