// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The instruments: numbers, gears, bars, keys, lights, limits and warnings of a vehicle. */

import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { Hud } from '../../page/cockpit/js/driving/hud.js';
import { Keyboard } from '../../page/cockpit/js/driving/keyboard.js';
import { VEHICLE } from '../../page/cockpit/js/frames.js';
import { liveStore, openPage, Pictures, send, textOf } from './dom_support.mjs';
import { laneletOf, stateFrame } from './support.mjs';

const VEHICLES = [{ id: 'hv0', role: 'human', max_steering_angle: 0.5 },
  { id: 'av0', role: 'autonomous', max_steering_angle: 0.8 }];
const SCENE = { lanelets: [laneletOf({ id: 7, speed_limit: 50 / 3.6 })],
  events: [{ name: 'slow', kind: 'speed_limit', speed: 30 / 3.6, lanelets: [] }] };

let root, store, pictures, subject, keyboard, n;

beforeEach(() => {
  root = openPage('<div id="hud"></div>').firstElementChild;
  pictures = new Pictures();
  store = liveStore(VEHICLES, SCENE);
  store.receive({ type: 'status', run: 'paused', n: 0, epoch: 0 });
  keyboard = new Keyboard(() => true, { changed() {}, reversed() {} });
  subject = { id: 'hv0', driven: true, away: null, lost: '', reverse: false,
    driver: 'Keyboard' };
  n = 0;
  new Hud(root, store, () => subject, keyboard);
});

/** Give the state of hv0, and draw it once its numbers are written again. */
function drive(values, av = {}) {
  n += 100;
  const row = (own) => {
    const list = Array.from({ length: 13 }, () => 0);
    Object.entries(own).forEach(([name, value]) => { list[VEHICLE[name]] = value; });
    return list;
  };
  store.receiveFrame(stateFrame({ n, t: n / 100 }, row(values), row({ x: 50, ...av })),
    pictures.now_ms);
  pictures.draw(400);
}

const find = (name) => root.querySelector(`.${name}`);
const told = (...names) => names.map((name) => find(`hud-${name}`).textContent);
const on = (name) => find(name).hasAttribute('data-on');
const hold = (code, type = 'keydown') => send(globalThis.window, type, { code, key: code });

test('there are no instruments without a vehicle or before its state', () => {
  pictures.draw();
  assert.ok(root.hidden);
  drive({});
  assert.ok(!root.hidden);
  for (const id of [null, 'hv9']) {
    subject = { ...subject, id };
    pictures.draw();
    assert.ok(root.hidden, id);
  }
});

test('speed and acceleration have their signs, and none at zero', () => {
  drive({ speed: 20.04, acceleration: -3.26, steering_angle: 0.1, steering: 0.25 });
  assert.deepEqual(told('kmh', 'ms', 'acceleration', 'angle', 'command'),
    ['72', '+20.0 m/s', '−3.3 m/s²', '+5.7°', '+25 %']);
  drive({ speed: -2, acceleration: 0.04, steering_angle: -0.0001, steering: -1 });
  assert.deepEqual(told('kmh', 'ms', 'acceleration', 'angle', 'command'),
    ['7', '−2.0 m/s', '0.0 m/s²', '0.0°', '−100 %']);
});

test('what nobody commands is a dash', () => {
  drive({ steering: NaN, throttle: NaN, brake: NaN, acceleration: NaN });
  assert.deepEqual(told('command', 'acceleration'), ['–', '– m/s²']);
  assert.deepEqual([...root.querySelectorAll('.bar-value')].map(({ textContent }) => textContent),
    ['–', '–']);
});

test('the gear is that of the motion; a wanted one is told until it is engaged', () => {
  for (const [speed, reverse, gear, shown] of [[10, 0, 'D', 'D'], [10, 1, 'D', 'D→R'],
    [0, 1, 'R', 'R'], [0.04, 1, 'R', 'R'], [-1, 1, 'R', 'R'], [-1, 0, 'R', 'R→D'],
    [0, NaN, 'D', 'D'], [-1, NaN, 'R', 'R']]) {
    drive({ speed, reverse });
    assert.deepEqual([find('hud-gear').dataset.gear, ...told('gear')], [gear, shown],
      `${speed} ${reverse}`);
  }
});

test('the bars have the commands, and outlines the held keys', () => {
  drive({ throttle: 0.5, brake: 0.257, steering: 0.5 });
  const bar = (name) => find(`pedal-${name}`);
  assert.deepEqual(['throttle', 'brake'].map((name) => textOf(bar(name))),
    ['50 % Throttle', '26 % Brake']);
  assert.equal(bar('throttle').querySelector('.bar-fill').style.transform, 'scaleY(0.500)');
  assert.equal(find('steering-bar').querySelector('.bar-fill').style.transform, 'scaleX(-0.500)');
  const outlines = () => ['pedal-throttle .bar-key', 'pedal-brake .bar-key', 'bar-left',
    'bar-right'].map(on);
  assert.deepEqual(outlines(), [false, false, false, false]);
  hold('ArrowUp');
  hold('KeyA');
  pictures.draw();
  assert.deepEqual(outlines(), [true, false, true, false]);
  subject = { ...subject, driven: false };
  pictures.draw();
  assert.deepEqual(outlines(), [false, false, false, false], 'these keys drive nothing');
});

test('the wheel turns with the command, without one with the front wheels', () => {
  const turned = () => find('wheel-turning').getAttribute('transform');
  drive({ steering: 0.5, steering_angle: -0.5 });
  assert.equal(turned(), 'rotate(-75.0)');
  drive({ steering: NaN, steering_angle: -0.25 });
  assert.equal(turned(), 'rotate(75.0)');
  subject = { ...subject, id: 'av0' };
  drive({}, { steering: NaN, steering_angle: 0.4 });
  assert.equal(turned(), 'rotate(-75.0)', 'by its own largest angle');
});

test('the keys are lit while they are held, R with the gear, and only for the driver', () => {
  drive({});
  const lit = () => [...root.querySelectorAll('.cap[data-on]')].map(textOf);
  assert.deepEqual(lit(), []);
  hold('ArrowDown');
  hold('KeyG');
  subject.reverse = true;
  pictures.draw();
  assert.deepEqual(lit(), ['R', 'S', 'G ♪']);
  hold('ArrowDown', 'keyup');
  pictures.draw();
  assert.deepEqual(lit(), ['R', 'G ♪']);
  assert.ok(!find('keycaps').hidden && root.hasAttribute('data-driven'));
  subject = { ...subject, driven: false };
  pictures.draw();
  assert.ok(find('keycaps').hidden && !root.hasAttribute('data-driven'));
});

test('a drawn key is pressed and let go by a finger, two at once', () => {
  drive({});
  const cap = (code) => Object.assign(find(`cap-${code}`), { setPointerCapture() {} });
  assert.ok(send(cap('KeyW'), 'pointerdown', { pointerId: 1 }).defaultPrevented);
  send(cap('KeyA'), 'pointerdown', { pointerId: 2 });
  assert.deepEqual(keyboard.keys, [1, 0, 1, 0]);
  send(cap('KeyW'), 'pointerup');
  assert.deepEqual(keyboard.keys, [0, 0, 1, 0]);
  send(cap('KeyA'), 'pointercancel');
  assert.deepEqual(keyboard.keys, [0, 0, 0, 0]);
  assert.ok(send(cap('KeyA'), 'contextmenu').defaultPrevented);
});

test('indicators blink in simulation time, while words say once that they are on', () => {
  const signs = () => ['left', 'horn', 'right'].map((name) => on(`sign-${name}`));
  n = -50;
  drive({ lights: 1 });
  assert.deepEqual(signs(), [false, false, false], 'dark at 0.5 s');
  assert.equal(find('sign-left').getAttribute('aria-label'), 'Left indicator on');
  drive({ lights: 3 });
  assert.deepEqual(signs(), [true, false, true], 'lit at 1.5 s');
  drive({ lights: 4 });
  assert.deepEqual(signs(), [false, true, false]);
  assert.equal(find('sign-left').getAttribute('aria-label'), 'Left indicator off');
});

test('the sign has the limit of the lane, and tells when it is exceeded', () => {
  const sign = () => [told('limit')[0], on('hud-limit'),
    find('hud-limit').hasAttribute('data-over')];
  drive({ x: 10, speed: 14 });
  assert.deepEqual(sign(), ['50', true, false], 'within rounding');
  assert.equal(find('hud-limit').getAttribute('aria-label'), 'Speed limit 50 km/h');
  drive({ x: 10, speed: 14.5 });
  assert.deepEqual(sign(), ['50', true, true]);
  drive({ x: 10, y: 90, speed: 60 });
  assert.deepEqual(sign().slice(1), [false, false], 'beside the road');
});

test('an event sets another limit, and an end of it brings back the usual one', () => {
  drive({ x: 10 });
  store.receive({ type: 'events', fired: [{ name: 'slow', n: 1, k: 0, by: 'trigger' }] });
  drive({ x: 10, speed: 10 });
  assert.deepEqual([...told('limit'), find('hud-limit').hasAttribute('data-over')], ['30', true]);
  store.receive({ ...store.scene, type: 'scene' });
  drive({ x: 10 });
  assert.deepEqual(told('limit'), ['30'], 'a new scene keeps what has fired');
  store.receive({ type: 'events', fired: [] });
  drive({ x: 10 });
  assert.deepEqual(told('limit'), ['50']);
});

test('it says who is driven or watched, and by what', () => {
  drive({});
  assert.deepEqual(told('who', 'device'), ['You drive hv0', 'Keyboard']);
  assert.equal(find('hud-board').dataset.role, 'human');
  subject = { ...subject, id: 'av0', driven: false, driver: 'Driven by <b>Bob</b>' };
  drive({}, { speed: 10 });
  assert.deepEqual(told('who', 'device', 'kmh'), ['Watching av0', 'Driven by <b>Bob</b>', '36']);
  assert.equal(find('hud-board').dataset.role, 'autonomous');
  assert.ok(!root.querySelector('b'));
});

test('the banner says why the hands are off, or that the connection is lost', () => {
  const banner = (more) => {
    subject = { ...subject, driven: true, away: null, lost: '', ...more };
    drive({});
    return find('hud-banner').hasAttribute('data-on') ? told('banner')[0] : '';
  };
  assert.equal(banner({}), '');
  assert.equal(banner({ away: 'hidden' }), 'Hands off: this page is hidden.');
  assert.equal(banner({ away: 'focus' }), 'Hands off: click into this page to drive on.');
  assert.equal(banner({ away: 'dialog' }), 'Hands off while a dialog is open.');
  assert.match(banner({ away: 'unplugged' }), /^The input device is unplugged: press a driving/);
  assert.equal(banner({ driven: false, away: 'focus' }), '', 'who only watches needs no focus');
  assert.equal(banner({ driven: false, away: 'connection', lost: 'Connection lost: <i>' }),
    'Connection lost: <i>');
});

test('numbers change ten times a second at most, but at once for another vehicle', () => {
  drive({ speed: 10 });
  n += 1;
  store.receiveFrame(stateFrame({ n, t: n / 100 }, [0, 0, 0, 20], [0, 0, 0, 30]), pictures.now_ms);
  pictures.draw(50);
  assert.deepEqual(told('kmh'), ['36']);
  pictures.draw(50);
  assert.deepEqual(told('kmh'), ['72']);
  subject = { ...subject, id: 'av0' };
  pictures.draw(1);
  assert.deepEqual(told('kmh'), ['108']);
});
