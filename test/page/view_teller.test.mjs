// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** When a page tells what its 3D view shows, and what lies over it. */

import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';
import { setImmediate as soon } from 'node:timers/promises';

import { ViewTeller } from '../../page/cockpit/js/view3d/view_teller.js';
import { liveStore, openPage } from './dom_support.mjs';

const VEHICLES = [{ id: 'hv0', role: 'human' }, { id: 'av0', role: 'autonomous' }];
const CAR = ['vehicle', 'av0', 0.4, 0.5, 0.6, 0.7, 12.5, null];
const EYE = [0, 0, 0, 1.2, 0, 1, 0.5];
let sent, stage, store, teller, picture;

/** Give an element a place on the page [CSS px]. */
function place(node, left, top, width, height) {
  node.getBoundingClientRect = () => ({ left, top, width, height, right: left + width,
    bottom: top + height });
  return node;
}

beforeEach(() => {
  const body = openPage('<div id="stage"></div><div id="hud"><div class="hud-board">'
    + '<div class="hud-speed"></div></div></div>');
  const sizes = { crgame: {}, devicePixelRatio: 2, screenX: 30, screenY: 40, outerWidth: 1010,
    innerWidth: 1000, outerHeight: 685, innerHeight: 600, screen: { width: 1920, height: 1080 } };
  for (const [name, value] of Object.entries(sizes)) {
    Object.defineProperty(globalThis.window, name, { value, configurable: true });
  }
  globalThis.window.matchMedia = () => ({ matches: false });
  stage = place(body.querySelector('#stage'), 100, 0, 800, 600);
  place(body.querySelector('.hud-board'), 100, 500, 800, 100);
  place(body.querySelector('.hud-speed'), 300, 510, 200, 80);
  store = liveStore(VEHICLES, { gaze: ['hv0'] });
  store.receive({ type: 'seats', seats: { hv0: { holder: 'c1' }, av0: { holder: null } } });
  store.epoch = 4;
  store.serverClock.add(0, 2, 1000);
  sent = [];
  picture = { contents: () => ({ eye: EYE, shown: [CAR] }) };
  teller = new ViewTeller(stage, store, { send: (message) => sent.push(message) });
});

test('the view is told of a driver whose gaze the game names, by the page with the seat', () => {
  assert.deepEqual(['hv0', 'av0', null].map((id) => teller.wants(id)), [true, false, false]);
  store.receive({ type: 'seats', seats: { hv0: { holder: 'c2' } } });
  assert.equal(teller.wants('hv0'), false);
  const off = new ViewTeller(stage, liveStore(VEHICLES), null);
  assert.equal(off.wants('hv0'), false);
});

test('a picture has its time, its place on the screen and what lies over it', async () => {
  const light = place(globalThis.document.createElement('div'), 500, 150, 40, 30);
  globalThis.window.crgame.tasks = { shown: [{ task: 'drt', node: light }] };
  teller.tell(1000, picture, 'hv0');
  await soon();
  await soon();
  const [{ type, picture: told }] = sent;
  assert.equal(type, 'picture');
  assert.deepEqual([told.seat, told.epoch, told.eye], ['hv0', 4, EYE]);
  // The page's clock was at 1 ms when the server's was at 1000 s; half of 2 ms is the error.
  assert.ok(Math.abs(told.steady_s - 1000 - (performance.now() - 1) / 1000) < 5);
  assert.equal(told.clock_error_ms, 1);
  // The window's frame is 5 px wide, and its head 85 - 5 px high.
  assert.deepEqual(told.place, [30 + 5 + 100, 40 + 80, 800, 600, 1920, 1080, 2]);
  assert.deepEqual(told.shown, [
    ['task', 'drt', 0.5, 0.25, 0.55, 0.3, null, null],
    ['instrument', 'speedometer', 0.25, 0.85, 0.5, 0.9833, null, null],
    ['instrument', 'dashboard', 0, 0.8333, 1, 1, null, null], CAR]);
});

test('a mouse tells where the page is; a window that fills the screen has no place', async () => {
  globalThis.window.dispatchEvent(Object.assign(new globalThis.Event('pointermove'),
    { screenX: 430, screenY: 240, clientX: 380, clientY: 110 }));
  teller.tell(1000, picture, 'hv0');
  globalThis.window.matchMedia = () => ({ matches: true });
  teller.tell(1100, picture, 'hv0');
  await soon();
  await soon();
  assert.deepEqual(sent.map(({ picture: { place: [left, top] } }) => [left, top]),
    [[100 + 430 - 380, 240 - 110], [100 + 430 - 380 - 30, 240 - 110 - 40]]);
});

test('ten pictures a second are told, none while the clocks are not related', async () => {
  for (let frame = 0; frame < 60; frame += 1) {
    teller.tell(frame * 1000 / 60, picture, 'hv0');
  }
  teller.tell(5000, { contents: () => null }, 'hv0');
  await soon();
  await soon();
  assert.equal(sent.length, 10);
  store.serverClock.forget();
  teller.tell(9000, picture, 'hv0');
  await soon();
  await soon();
  assert.equal(sent.length, 10);
});

test('of more than the server takes the nearest are told, the foremost first', async () => {
  // Mirrors come first, and show cars that are farther away than those on the road ahead.
  const cars = (count, distance_m, mirror) => Array.from({ length: count }, (_, i) => [
    'vehicle', `o${i}`, 0.4, 0.5, 0.6, 0.7, distance_m + i, mirror]);
  const [behind, ahead] = [cars(150, 200, 'mirror_left'), cars(150, 0, null)];
  const glass = ['mirror', 'mirror_left', 0.1, 0.4, 0.3, 0.6, null, null];
  picture.contents = () => ({ eye: EYE, shown: [...behind, glass, ...ahead] });
  teller.tell(0, picture, 'hv0');
  await soon();
  await soon();
  // Two instruments lie over the view.
  assert.deepEqual(sent[0].picture.shown.slice(2), [...behind.slice(0, 47), glass, ...ahead]);
});
