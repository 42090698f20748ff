// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The connection: replies reach their requests, and a broken one is restored. */

import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { Connection } from '../../page/cockpit/js/connection.js';
import { InputSender } from '../../page/cockpit/js/driving/sender.js';
import { ServerClock } from '../../page/cockpit/js/server_clock.js';
import { DeskConnection } from '../../page/desk/js/desk_connection.js';
import { close, frameOf } from './support.mjs';

/** A server that a test controls. */
class FakeSocket extends EventTarget {
  static OPEN = 1;
  static all = [];
  readyState = 0;
  sent = [];

  constructor(url) {
    super();
    this.url = url;
    FakeSocket.all.push(this);
  }

  accept() {
    this.readyState = 1;
    this.dispatchEvent(new Event('open'));
  }

  send(text) {
    this.sent.push(JSON.parse(text));
  }

  say(data) {
    this.dispatchEvent(Object.assign(new Event('message'), {
      data: data instanceof ArrayBuffer ? data : JSON.stringify(data) }));
  }

  close() {
    this.readyState = 3;
    this.dispatchEvent(new Event('close'));
  }
}

globalThis.WebSocket = FakeSocket;
globalThis.window = { location: new URL('http://127.0.0.1:8080/') };

beforeEach((t) => {
  t.mock.timers.enable({ apis: ['setTimeout', 'setInterval'] });
  FakeSocket.all.length = 0;
});

function connected() {
  const told = [];
  const store = { serverClock: new ServerClock(), setConnected: (on) => told.push(on),
    receive: (message) => told.push(message),
    receiveFrame: (frame) => told.push(frame) };
  const connection = new Connection(store);
  const [socket] = FakeSocket.all;
  socket.accept();
  return { connection, socket, store, told };
}

test('the address is that of the page', () => {
  assert.equal(connected().socket.url, 'ws://127.0.0.1:8080/ws');
  globalThis.window.location = new URL('https://host/x?y');
  const connection = new Connection({ setConnected() {} });
  assert.equal(FakeSocket.all.at(-1).url, 'wss://host/ws');
  assert.equal(connection.socket.open, false);
  globalThis.window.location = new URL('http://127.0.0.1:8080/');
});

test('documents and frames go to the store', () => {
  const { socket, told } = connected();
  const frame = frameOf(1);
  socket.say({ type: 'signals', k: 1 });
  socket.say(frame);
  assert.deepEqual(told, [true, { type: 'signals', k: 1 }, frame]);
});

test('each reply reaches its request, in any order', async () => {
  const { connection, socket } = connected();
  const replies = [1, 2].map((factor) => connection.request({ type: 'rate', factor }));
  const [first, second] = socket.sent;
  assert.notEqual(first.id, second.id);
  socket.say({ type: 'reply', to: second.id, ok: true, text: 'second' });
  socket.say({ type: 'reply', to: first.id, ok: false, text: 'first' });
  assert.deepEqual((await Promise.all(replies)).map(({ ok, text }) => [ok, text]),
    [[false, 'first'], [true, 'second']]);
});

test('a missing answer within ten seconds or a broken connection is a refusal', async (t) => {
  const { connection, socket } = connected();
  const late = connection.request({ type: 'trigger', event: 'a' });
  t.mock.timers.tick(10_000);
  assert.deepEqual(await late, { ok: false, text: 'The simulation did not answer within 10 s.' });
  const broken = connection.request({ type: 'trigger', event: 'a' });
  socket.close();
  assert.equal((await broken).text, 'The connection broke before the answer came.');
  assert.equal((await connection.request({ type: 'trigger', event: 'a' })).text,
    'There is no connection to the simulation.');
});

test('it reconnects after 0.25 s, then after twice as long each time, up to 2 s', (t) => {
  const { socket, told } = connected();
  socket.close();
  assert.deepEqual(told, [true, false]);
  for (const wait_ms of [250, 500, 1000, 2000, 2000]) {
    const count = FakeSocket.all.length;
    t.mock.timers.tick(wait_ms - 1);
    assert.equal(FakeSocket.all.length, count);
    t.mock.timers.tick(1);
    assert.equal(FakeSocket.all.length, count + 1, `after ${wait_ms} ms`);
    FakeSocket.all.at(-1).close();
  }
  t.mock.timers.tick(2000);
  FakeSocket.all.at(-1).accept();
  assert.equal(told.at(-1), true);
  FakeSocket.all.at(-1).close();
  const count = FakeSocket.all.length;
  t.mock.timers.tick(250);
  assert.equal(FakeSocket.all.length, count + 1, 'the waits begin anew');
});

test('a closed connection does not reconnect', (t) => {
  const { connection } = connected();
  connection.socket.close();
  t.mock.timers.tick(60_000);
  assert.equal(FakeSocket.all.length, 1);
});

test('the answer time is measured once a second', (t) => {
  let now_ms = 100;
  t.mock.method(performance, 'now', () => now_ms);
  const { socket, store } = connected();
  t.mock.timers.tick(1000);
  assert.deepEqual(socket.sent, [{ type: 'ping', t: 100 }]);
  now_ms = 142;
  socket.say({ type: 'pong', t: 100, steady_s: 7 });
  assert.equal(store.round_trip_ms, 42);
  assert.deepEqual(store.serverClock.at(121), { steady_s: 7, clock_error_ms: 21 });
});

test('input is sent at each change and twenty times a second, hands off once', (t) => {
  const sent = [];
  let hands = { keys: [0, 0, 0, 0], reverse: 0 };
  const sender = new InputSender({ send: (message) => sent.push(message) }, () => hands);
  t.mock.timers.tick(200);
  assert.deepEqual(sent, [], 'without a seat nothing');
  sender.seat = 'hv0';
  sender.update();
  assert.deepEqual(sent, [{ type: 'input', seat: 'hv0', keys: [0, 0, 0, 0], reverse: 0 }]);
  hands = { keys: [1, 0, 0, 0], reverse: 0 };
  sender.update();
  assert.equal(sent.length, 2);
  // At 250 ms and every 50 ms up to 450 ms.
  t.mock.timers.tick(250);
  assert.equal(sent.length, 7);
  hands = { away: true };
  sender.update();
  t.mock.timers.tick(500);
  assert.deepEqual(sent.slice(7), [{ type: 'input', seat: 'hv0', away: true }]);
  sender.seat = null;
  hands = { keys: [1, 1, 1, 1], reverse: 0 };
  t.mock.timers.tick(500);
  assert.equal(sent.length, 8);
});

test("the desk's clock follows a page's clock that drifts, and a new connection", (t) => {
  let now_ms = 1000;
  t.mock.method(performance, 'now', () => now_ms);
  const desk = new DeskConnection('ws', { opened() {}, lost() {}, received() {} });
  const pong = (at_s, trip_ms) => {
    const sent = now_ms;
    now_ms += trip_ms;
    FakeSocket.all.at(-1).say({ type: 'pong', t: sent, at: at_s + trip_ms / 2000 });
  };
  close(desk.now_s, (performance.timeOrigin + now_ms) / 1000);
  FakeSocket.all[0].accept();
  pong(1e9, 2);
  close(desk.now_s, 1e9 + 0.002, 1e-6);
  // An hour in which the page's clock loses 100 ms: the quickest ping of all was the first.
  for (let s = 1; s <= 3600; s += 1) {
    now_ms = 1000 + 999.972 * s;
    pong(1e9 + s, s % 10 === 0 ? 4 : 20);
  }
  close(desk.now_s, 1e9 + 3600.004, 0.003);
  FakeSocket.all[0].close();
  t.mock.timers.tick(250);
  FakeSocket.all.at(-1).accept();
  close(desk.now_s, 1e9 + 3600.004, 0.003);
  pong(2e9, 90);
  close(desk.now_s, 2e9 + 0.09, 1e-6);
});
