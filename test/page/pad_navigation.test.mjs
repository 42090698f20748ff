// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Questions answered by the buttons of a gamepad or a wheel. */

import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { PadNavigation } from '../../page/desk/js/pad_navigation.js';
import { expose, openPage, Pictures, send } from './dom_support.mjs';

const radios = (name, checked = '') => `<fieldset class="question" id="${name}">${[1, 2, 3].map(
  (i) => `<input type="radio" name="${name}" id="${name}${i}" ${checked === i ? 'checked' : ''}>`
).join('')}</fieldset>`;
const SHEET = `${radios('a')}${radios('b', 2)}
  <fieldset class="question" id="c"><input type="checkbox" id="c1"><input type="checkbox" id="c2">
  </fieldset>
  <div class="question"><input type="range" id="line" min="0" max="10" step="1" value="5"></div>
  <div class="question"><textarea id="words"></textarea></div>
  <button id="off" disabled></button><button id="gone" hidden></button>
  <button id="back">Back</button><button id="next">Next</button>`;
const WHEEL = { previous: 5, next: 4, confirm: 0, up: 1 };
const STANDARD = { previous: 14, next: 15, up: 12, down: 13, confirm: 0 };

let pictures, pad, buttons, heard;

beforeEach(() => {
  openPage(`<main id="sheet">${SHEET}</main><section id="drive" hidden><button id="gate">Ready
    </button></section>`);
  expose('HTMLButtonElement');
  pictures = new Pictures();
  heard = [];
  for (const kind of ['change', 'input', 'click']) {
    document.addEventListener(kind, ({ target }) => heard.push(`${kind} ${target.id}`));
  }
  // As browsers do, and happy-dom does not.
  const line = find('line');
  line.stepUp = () => { line.value = String(Number(line.value) + 1); };
  line.stepDown = () => { line.value = String(Number(line.value) - 1); };
});

/** Connect a device, which appears by a press of its last button. */
function connect(orders, mapping = orders === STANDARD ? 'standard' : '') {
  buttons = orders;
  pad = { index: 0, connected: true, mapping,
    buttons: Array.from({ length: 17 }, (_, i) => ({ pressed: i === 16 })) };
  globalThis.navigator.getGamepads = () => [null, pad];
  new PadNavigation(find('sheet'), find('drive'));
  hold();
}

const find = (id) => document.getElementById(id);
const focused = () => document.activeElement?.id ?? '';
const hold = (...indexes) => {
  pad.buttons = pad.buttons.map((_, i) => ({ pressed: indexes.includes(i) }));
  pictures.draw();
};

/** Press and let go the button of an order. */
function order(...names) {
  for (const name of names) {
    hold(buttons[name]);
    hold();
  }
  return focused();
}

const checked = () => [...document.querySelectorAll('input:checked')].map(({ id }) => id);

test('the first order goes to the first question, or to its answer', () => {
  connect(WHEEL);
  assert.equal(order('next'), 'a1');
  assert.deepEqual(checked(), ['b2'], 'nothing is answered by it');
  find('a').remove();
  assert.equal(order('previous'), 'b2');
});

test('a place is chosen by paddles, between the ends, and confirmed', () => {
  connect(WHEEL);
  order('next', 'next');
  assert.deepEqual([focused(), checked()], ['a1', ['a1', 'b2']]);
  order('next');
  assert.deepEqual([focused(), checked()], ['a2', ['a2', 'b2']]);
  order('next', 'next', 'next');
  assert.deepEqual([focused(), checked()], ['a3', ['a3', 'b2']]);
  order('previous', 'previous', 'previous', 'previous');
  assert.deepEqual([focused(), checked()], ['a1', ['a1', 'b2']]);
  assert.equal(order('confirm'), 'b2', 'the next question, at its answer');
  assert.equal(order('up'), 'a1');
});

test('confirming a question without an answer takes the first place', () => {
  connect(WHEEL);
  order('confirm', 'confirm');
  assert.deepEqual([focused(), checked()], ['a1', ['a1', 'b2']]);
  assert.ok(heard.includes('change a1'), 'the form is told');
});

test('boxes are gone through, and each is confirmed by itself', () => {
  connect(STANDARD);
  find('c1').focus();
  assert.equal(order('next'), 'c2');
  assert.deepEqual(checked(), ['b2']);
  order('confirm');
  assert.deepEqual(checked(), ['b2', 'c2']);
  order('confirm');
  assert.deepEqual(checked(), ['b2']);
  assert.equal(order('down'), 'line');
});

test('a wheel leaves a question of boxes forward', () => {
  connect(WHEEL);
  find('c1').focus();
  assert.equal(order('next', 'confirm'), 'c2');
  assert.deepEqual(checked(), ['b2', 'c2']);
  assert.equal(order('next'), 'line');
});

test('a line is moved step by step, which marks it', () => {
  connect(WHEEL);
  find('line').focus();
  order('next', 'next', 'previous');
  assert.equal(find('line').value, '6');
  assert.equal(heard.filter((each) => each === 'input line').length, 3);
  assert.equal(order('confirm'), 'words');
});

test('a text is passed, and keeps what was typed', () => {
  connect(STANDARD);
  find('words').focus();
  find('words').value = 'so';
  assert.equal(order('next', 'previous'), 'words');
  assert.equal(order('confirm'), 'back');
  assert.equal(find('words').value, 'so');
});

test('usable buttons are gone through, and pressed by confirming', () => {
  connect(WHEEL);
  find('words').focus();
  assert.equal(order('confirm'), 'back');
  assert.equal(order('next'), 'next');
  assert.equal(order('next'), 'next', 'there is nothing after it');
  assert.deepEqual(heard, []);
  order('confirm');
  assert.deepEqual(heard, ['click next']);
  assert.equal(order('previous', 'previous'), 'words');
});

test('what is not drawn is left out', () => {
  connect(WHEEL);
  Object.defineProperty(find('back'), 'offsetParent', { value: null });
  find('words').focus();
  assert.equal(order('confirm'), 'next');
});

test('arrows and shoulder buttons of a gamepad do the same', () => {
  connect(STANDARD);
  assert.equal(order('down', 'down'), 'b2');
  assert.equal(order('up'), 'a1');
  hold(5);
  assert.deepEqual(checked(), ['a1', 'b2'], 'the right shoulder: on');
  order('next');
  hold(4);
  assert.deepEqual([focused(), checked()], ['a1', ['a1', 'b2']], 'the left one: back');
});

test('a held button counts once, and so does not the press that shows a device', () => {
  connect(WHEEL);
  find('a1').focus();
  hold(4);
  hold(4);
  hold(4);
  assert.equal(focused(), 'a1');
  hold(4, 7);
  assert.deepEqual([focused(), checked()], ['a1', ['a1', 'b2']]);
  const other = { index: 1, connected: true, mapping: '', buttons: [{ pressed: true }] };
  globalThis.navigator.getGamepads = () => [pad, other];
  find('next').focus();
  send(globalThis.window, 'gamepadconnected');
  assert.ok(!heard.includes('click next'));
  other.buttons = [{ pressed: false }];
  pictures.draw();
  other.buttons = [{ pressed: true }];
  pictures.draw();
  assert.ok(heard.includes('click next'));
});

test('a device is heard as soon as it is connected, and once in each picture', () => {
  globalThis.navigator.getGamepads = () => [];
  new PadNavigation(find('sheet'), find('drive'));
  assert.equal(pictures.waiting, 0, 'nothing is asked without a device');
  pad = { index: 0, connected: true, mapping: '', buttons: [{ pressed: false }] };
  globalThis.navigator.getGamepads = () => [pad];
  send(globalThis.window, 'gamepadconnected');
  send(globalThis.window, 'gamepadconnected');
  assert.equal(pictures.waiting, 1);
  find('next').focus();
  hold(0);
  assert.deepEqual(heard, ['click next']);
  pad.connected = false;
  pictures.draw();
  assert.equal(pictures.waiting, 0);
});

test('before a drive, the gate alone is confirmed', () => {
  connect(WHEEL);
  find('drive').hidden = false;
  assert.equal(order('next'), 'gate');
  order('confirm');
  assert.deepEqual(heard, ['click gate']);
});

test('in a dialog, and during the check of the controls, no button acts', () => {
  connect(WHEEL);
  const dialog = document.createElement('dialog');
  dialog.setAttribute('open', '');
  document.body.append(dialog);
  find('next').focus();
  order('confirm');
  assert.deepEqual(heard, []);
  dialog.remove();
  const check = document.createElement('div');
  check.className = 'device-check';
  find('sheet').append(check);
  order('confirm');
  assert.deepEqual(heard, []);
  check.setAttribute('data-complete', '');
  order('confirm');
  assert.deepEqual(heard, ['click next']);
});
