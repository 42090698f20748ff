// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The people at the cockpit: who is there, the role that one takes, and links for others. */

import assert from 'node:assert/strict';
import { afterEach, beforeEach, mock, test } from 'node:test';

import { nameField } from '../../page/cockpit/js/driving/name_field.js';
import { People } from '../../page/cockpit/js/people.js';
import { Person } from '../../page/cockpit/js/person.js';
import { click, liveStore, openPage, RIGHTS, Server, textOf } from './dom_support.mjs';

const VEHICLES = [{ id: 'hv0', role: 'human' }, { id: 'hv1', role: 'human' },
  { id: 'av0', role: 'autonomous' }];
const DIRECTOR = { role: 'director', directs: true, drives: true, seat: '', may_direct: true,
  may_drive: true };
const ADA = { client: 'c1', name: 'Ada', role: 'director', seat: null, away: false,
  round_trip_ms: null, input_delay_ms: null };
const BOB = { ...ADA, client: 'c2', name: 'Bob', role: 'driver', seat: 'hv1' };

let root, server, store;

/** Open a page at an address; the session's storage is empty. */
const open = (address = 'http://127.0.0.1:8080/') => {
  root = openPage();
  globalThis.window.happyDOM.setURL(address);
  globalThis.window.crgame = {};
  Object.defineProperty(globalThis, 'sessionStorage', {
    value: globalThis.window.sessionStorage, configurable: true });
  server = new Server();
};

const begin = () => {
  store = liveStore(VEHICLES);
  new People(root, store, server);
};

beforeEach(() => {
  open();
  begin();
});

afterEach(() => mock.restoreAll());

const show = (people, devices = []) => store.receive({ type: 'people', people, devices });
const rights = (more) => store.receive({ type: 'you', rights: { ...DIRECTOR, ...more },
  accepted: true });
const hello = () => store.receive({ type: 'hello', client: 'c7', name: 'Ada', mode: 'live',
  version: '1', rights: DIRECTOR });
const rows = () => [...root.querySelectorAll('.people li')].map((line) => textOf(line));
const roleRow = () => root.querySelector('.people-role');
const select = () => root.querySelector('#my-role');
const optionsOf = (node) => [...node.options].map(({ value }) => value);
// The option that a browser chooses in a list that has just been filled.
const inUse = () => select().querySelector('[selected]').value;
const choose = async (role) => {
  select().value = role;
  select().dispatchEvent(new Event('change'));
  await click(document.body);
};
const form = () => root.querySelector('.people-invite');
const link = () => form().querySelector('input');
const makeLink = async (whom) => {
  form().querySelector('select').value = whom;
  form().dispatchEvent(new Event('submit', { cancelable: true }));
  await click(document.body);
};
/** Answer the next requests; returns the list of them. */
const serve = (answer) => {
  const asked = [];
  mock.method(globalThis, 'fetch', async (path, options) => {
    asked.push([path, options]);
    return { ok: true, text: async () => JSON.stringify(answer()) };
  });
  return asked;
};

test('each person has a role, a seat and delays, and this page is marked', () => {
  show([{ ...ADA, round_trip_ms: 12.6 },
    { ...BOB, round_trip_ms: 80, input_delay_ms: 119.5 }, { ...BOB, client: 'c3', name: 'Cleo',
      role: 'spectator', seat: null }]);
  assert.deepEqual(rows(), ['Ada (you) director round trip 13 ms',
    'Bob driver in hv1 round trip 80 ms, input latency 120 ms', 'Cleo spectator']);
  show([ADA]);
  assert.deepEqual(rows(), ['Ada (you) director']);
});

test('a device at the machine of the game is listed after the people, with its delays', () => {
  show([ADA], [{ seat: 'hv1', device: 'generic_gamepad', command_ms: 1.25,
    input_delay_ms: 20.4 }, { seat: 'hv0', device: 'wheel', command_ms: null,
    input_delay_ms: null }]);
  assert.deepEqual(rows(), ['Ada (you) director', 'generic_gamepad drives hv1 at the machine of '
    + 'the game command latency 1.3 ms, input latency 20 ms',
  'wheel drives hv0 at the machine of the game']);
});

test('the possible roles are those that are granted, and the one in use is chosen', () => {
  assert.deepEqual([optionsOf(select()), inUse()],
    [['all', 'direct', 'drive', 'watch'], 'all']);
  rights({ drives: false });
  assert.equal(inUse(), 'direct');
  rights({ directs: false });
  assert.equal(inUse(), 'drive');
  rights({ directs: false, drives: false });
  assert.equal(inUse(), 'watch');
  rights({ directs: false, may_direct: false });
  assert.deepEqual([optionsOf(select()), inUse()], [['drive', 'watch'], 'drive']);
  rights({ drives: false, may_drive: false });
  assert.deepEqual([optionsOf(select()), inUse()], [['direct', 'watch'], 'direct']);
  assert.match(textOf(roleRow()), /^You take part as Director Spectator$/);
});

test('who can only watch has nothing to choose', () => {
  assert.ok(!roleRow().hidden);
  store.receive({ type: 'you', rights: RIGHTS.watch, accepted: true });
  assert.ok(roleRow().hidden);
});

test('a chosen role is asked for, and the select gives the driving keys back', async () => {
  select().focus();
  await choose('drive');
  assert.deepEqual(server.take(), [{ type: 'role', role: 'drive' }]);
  assert.notEqual(document.activeElement, select());
});

test('a new connection and a reloaded page ask for the chosen role again', async () => {
  await choose('watch');
  server.take();
  hello();
  assert.deepEqual(server.take(), [{ type: 'role', role: 'watch' }]);
  begin();
  assert.deepEqual(server.take(), [{ type: 'role', role: 'watch' }]);
});

test('without a choice a new connection asks for no role', () => {
  hello();
  assert.deepEqual(server.take(), []);
});

test('the address may name a role, which a choice replaces; others are ignored', async () => {
  open('http://127.0.0.1:8080/?role=drive');
  begin();
  assert.deepEqual(server.take(), [{ type: 'role', role: 'drive' }]);
  await choose('watch');
  server.take();
  hello();
  assert.deepEqual(server.take(), [{ type: 'role', role: 'watch' }]);
  open('http://127.0.0.1:8080/?role=admin');
  begin();
  hello();
  assert.deepEqual(server.take(), []);
});

test('a refusal of the server is a notice', async () => {
  const notices = [];
  store.on('notice', ({ level, text }) => notices.push([level, text]));
  server.reply = { ok: false, text: 'you are a spectator' };
  await choose('direct');
  assert.deepEqual(notices, [['warn', 'you are a spectator']]);
});

test('a role that was refused is not asked for again by the next connection', async () => {
  server.reply = { ok: false, text: 'you are a spectator' };
  await choose('direct');
  server.take();
  hello();
  assert.deepEqual(server.take(), []);
  server.reply = { ok: true, text: '' };
  await choose('watch');
  server.take();
  hello();
  assert.deepEqual(server.take(), [{ type: 'role', role: 'watch' }]);
});

test('a recording has no people, and its page asks for no role', async () => {
  await choose('drive');
  server.take();
  store.receive({ type: 'hello', client: 'c1', name: 'Ada', mode: 'replay', version: '1' });
  assert.equal(textOf(root), '');
  assert.deepEqual(server.take(), []);
  hello();
  assert.match(textOf(root), /^People/);
});

test('only a director of a cockpit that is open to the network makes links', () => {
  assert.ok(form().hidden);
  open('https://192.168.0.2:8080/');
  begin();
  assert.ok(!form().hidden);
  assert.deepEqual(optionsOf(form().querySelector('select')),
    ['drive hv0', 'drive hv1', 'watch', 'direct']);
  store.receive({ type: 'you', rights: RIGHTS.drive, accepted: true });
  assert.ok(form().hidden);
});

test('another game offers links for its own seats', () => {
  store.receive({ type: 'scene', time: { epoch: 1, dt_s: 0.01, dt_c_s: 0.1 },
    vehicles: [{ id: 'hv9', role: 'human' }], objects: [], events: [] });
  assert.deepEqual(optionsOf(form().querySelector('select')), ['drive hv9', 'watch', 'direct']);
});

test('a link is asked for with the key of this page, and shown to be copied', async () => {
  globalThis.window.crgame.person = { headers: { 'X-Crgame-Key': 'abc' } };
  const asked = serve(() => ({ link: 'https://192.168.0.2:8080/?key=1' }));
  assert.ok(link().hidden);
  await makeLink('drive hv1');
  await makeLink('watch');
  assert.deepEqual(asked.map(([path, { method, headers, body }]) => [path, method,
    headers['X-Crgame'], headers['X-Crgame-Key'], JSON.parse(body)]),
  [['/api/invite', 'POST', '1', 'abc', { role: 'drive', seat: 'hv1' }],
    ['/api/invite', 'POST', '1', 'abc', { role: 'watch', seat: '' }]]);
  assert.deepEqual([link().hidden, link().value, link().readOnly],
    [false, 'https://192.168.0.2:8080/?key=1', true]);
});

test('a refused link is said, and takes the former link away', async () => {
  const error = () => form().querySelector('[role=alert]').textContent;
  let answer = { link: 'https://192.168.0.2:8080/?key=1' };
  serve(() => answer);
  await makeLink('watch');
  answer = { error: 'Only a <b>director</b> makes links.' };
  await makeLink('direct');
  assert.deepEqual([error(), link().hidden, link().value],
    ['Only a <b>director</b> makes links.', true, '']);
  mock.restoreAll();
  mock.method(globalThis, 'fetch', async () => {
    throw new TypeError('fetch failed');
  });
  await makeLink('watch');
  assert.deepEqual([error(), link().hidden], ['The server does not answer.', true]);
  mock.restoreAll();
  serve(() => ({ link: 'https://192.168.0.2:8080/?key=2' }));
  await makeLink('watch');
  assert.deepEqual([error(), link().hidden], ['', false]);
});

test('an unfinished choice stays while people come and go', () => {
  form().querySelector('select').value = 'watch';
  select().value = 'drive';
  show([ADA, BOB]);
  assert.deepEqual([form().querySelector('select').value, select().value], ['watch', 'drive']);
});

test('names of people and devices stay text', () => {
  const name = `<b>Bob</b> ${'o'.repeat(3000)}`;
  show([{ ...BOB, name }], [{ seat: 'hv0', device: '<i>wheel</i>\n\u202egfx', command_ms: null,
    input_delay_ms: null }]);
  assert.deepEqual(rows(), [`${name} driver in hv1`,
    '\u2068<i>wheel</i> \u202egfx\u2069 drives hv0 at the machine of the game']);
  assert.equal(root.querySelector('b, i'), null);
});

test('without storage, people join, are named and choose their role as ever', async () => {
  for (const name of ['localStorage', 'sessionStorage']) {
    const forbidden = { get() { throw new Error('SecurityError'); }, configurable: true };
    Object.defineProperty(globalThis.window, name, forbidden);
    Object.defineProperty(globalThis, name, forbidden);
  }
  const sent = [];
  server.send = (message) => sent.push(message);
  const { headers } = new Person(root, store, server);
  root.append(nameField(store, server));
  assert.deepEqual(sent, [{ type: 'person', key: headers['X-Crgame-Key'], fresh: true }]);
  const field = root.querySelector('#my-name');
  field.value = 'Anna';
  field.dispatchEvent(new Event('change'));
  assert.deepEqual(sent.at(-1), { type: 'name', name: 'Anna' });
  rights({});
  await choose('watch');
  hello();
  assert.deepEqual(server.take().map(({ role }) => role), ['watch', 'watch']);
});
