// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The store: documents and frames across resets, and the picture at a time. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { KIND } from '../../page/cockpit/js/frames.js';
import { Store } from '../../page/cockpit/js/store.js';
import { keepShown } from '../../page/cockpit/js/world/shown.js';
import { close, frameOf, stateFrame } from './support.mjs';

const scene = (epoch, more) => ({ type: 'scene', time: { epoch, dt_s: 0.01, dt_c_s: 0.1 },
  vehicles: [{ id: 'hv0' }, { id: 'av0' }], objects: [], events: [], ...more });
const state = (epoch, n, ...rows) => stateFrame(
  { epoch, n, k: Math.floor(n / 10), t: n / 100 }, ...rows);
const objects = (k, ...values) => frameOf(KIND.OBJECTS, 0, 10 * k, k, k / 10,
  values.length / 6, ...values);
const status = (run) => ({ type: 'status', run, real_time_factor: 1 });

function running(...frames) {
  const store = new Store();
  store.setConnected(true);
  store.receive(scene(0));
  frames.forEach((frame, i) => store.receiveFrame(frame, 1000 + i));
  return store;
}

test('subscribers get their messages until they unsubscribe', () => {
  const store = new Store();
  const heard = [];
  const end = store.on('notice', ({ text }) => heard.push(text));
  store.on('alarms', () => heard.push(`alarms: ${store.alarms.length}`));
  store.receive({ type: 'notice', level: 'info', text: 'one' });
  store.receive({ type: 'alarms', active: [{ id: 'a' }] });
  end();
  store.receive({ type: 'notice', level: 'info', text: 'two' });
  assert.deepEqual(heard, ['one', 'alarms: 1']);
});

test('an unknown message of a newer server changes nothing', () => {
  const store = running(state(0, 1, [1]));
  store.receive({ type: 'weather', rain: 1 });
  assert.equal(store.latest.n, 1);
});

test('frames of a past epoch are dropped, those of a new one begin it', () => {
  const store = running(state(1, 500, [1]));
  store.receiveFrame(state(0, 900, [2]), 2000);
  assert.deepEqual([store.epoch, store.latest.n], [1, 500]);
  store.receiveFrame(state(2, 3, [3]), 2001);
  assert.deepEqual([store.epoch, store.latest.n, store.samples.length], [2, 3, 1]);
});

test('after a hello it may be another simulation, which has restarted', () => {
  const hello = { type: 'hello', client: 'c1', name: 'Guest', mode: 'live', version: '' };
  const store = running(state(3, 500, [1]));
  store.receive(hello);
  store.receiveFrame(state(0, 7, [2]), 2000);
  assert.deepEqual([store.epoch, store.latest.n], [0, 7]);
  // An earlier time of the same epoch is also a restart.
  store.receive(hello);
  store.receiveFrame(state(0, 2, [2]), 2001);
  assert.deepEqual([store.latest.n, store.samples.length], [2, 1]);
  // Without a hello it is not.
  store.receiveFrame(state(0, 1, [2]), 2002);
  assert.equal(store.latest.n, 2);
});

test('a recording played again restarts its epoch', () => {
  const store = running(state(0, 5, [1]));
  store.receive(scene(0));
  assert.equal(store.samples.length, 1);
  store.receive(scene(0, { again: 1 }));
  assert.equal(store.samples.length, 0);
});

test('rows of a scene with another number of vehicles are not mixed in', () => {
  const store = running(state(0, 1, [1]), state(0, 2, [1], [2]));
  assert.equal(store.samples.length, 1);
});

test('nothing is shown before the first state', () => {
  assert.equal(new Store().displayed(0), null);
});

test('the state between two samples is that of the time source', () => {
  const store = running(state(0, 100, [0, 0, 0, 10]), state(0, 110, [1, 2, 0, 20]));
  store.useTimeSource(() => 1.025);
  const shown = store.displayed(1);
  close([shown.t, shown.vehicles[0], shown.vehicles[1], shown.vehicles[3]],
    [1.025, 0.25, 0.5, 12.5], 1e-9);
  assert.deepEqual([shown.n, shown.k], [100, 10]);
});

test('vehicles are extrapolated beyond the newest sample', () => {
  const store = running(state(0, 100, [5, 0, 0, 10]));
  store.useTimeSource(() => 1.05);
  close(store.displayed(1).vehicles[0], 5.5);
});

test('it computes once per frame, and again after new data', () => {
  let asked = 0;
  const store = running(state(0, 100, [1]));
  store.useTimeSource(() => {
    asked += 1;
    return 1;
  });
  const first = store.displayed(5);
  assert.equal(store.displayed(5), first);
  assert.equal(asked, 1);
  store.receiveFrame(state(0, 101, [2]), 2000);
  store.displayed(5);
  assert.equal(asked, 2);
});

test('objects are extrapolated for at most one step and a tenth of a second', () => {
  const store = running(state(0, 100, [0]), objects(10, 5, 0, 0, 10, 0, 0));
  const x = (time) => {
    store.useTimeSource(() => time);
    return store.displayed(time).objects[0];
  };
  close([1.0, 1.05, 1.2, 1.5, 0.9].map(x), [5, 5.5, 7, 7, 5], 1e-9);
});

test('the newest state is shown while the run stands still or without a connection', () => {
  const store = running(...Array.from({ length: 100 }, (_, n) => state(0, n, [n])));
  store.receive(status('paused'));
  assert.equal(store.displayed(5000).t, 0.99);
  store.receive(status('running'));
  store.setConnected(false);
  assert.equal(store.displayed(6000).t, 0.99);
});

test('the past of a vehicle: every twentieth of a second, for a given time', () => {
  const store = running(...Array.from({ length: 301 }, (_, n) => state(0, n, [n], [-n])));
  const past = store.history(1, 1);
  // After 2 s and up to 3 s.
  assert.equal(past.t.length, 20);
  close([past.t[0], past.t.at(-1), past.x[0]], [2.05, 3, -205], 1e-9);
});

test('indices by id', () => {
  const store = running();
  assert.deepEqual([store.vehicleIndex('av0'), store.vehicleIndex('x'),
    new Store().vehicleIndex('av0')], [1, -1, -1]);
});

test('the drawn state is kept although the store refills its arrays', () => {
  const store = running(state(0, 100, [1]), state(0, 110, [2]));
  store.useTimeSource((now_ms) => now_ms / 1000);
  const kept = keepShown(null, store.displayed(1000));
  store.displayed(1100);
  assert.deepEqual([kept.t, kept.vehicles[0]], [1, 1]);
  const again = keepShown(kept, store.displayed(1050));
  assert.equal(again, kept);
  close([kept.t, kept.vehicles[0]], [1.05, 1.5], 1e-9);
  assert.equal(keepShown(kept, null), null);
});
