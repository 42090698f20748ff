// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Keys, hands on the canvas, preferences, colours and elements, without a browser. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { close, keepStorage } from './support.mjs';

/** The parts of an event target that tests need: `closest` and listeners. */
class FakeElement extends EventTarget {
  attributes = new Map();
  children = [];
  textContent = '';
  writes = 0;

  constructor(tag = 'div') {
    super();
    this.tag = tag;
    this.classList = { add() {}, remove() {} };
  }

  closest(selector) {
    return selector.split(',').some((part) => part.trim().startsWith(this.tag)) ? this : null;
  }

  append(...children) {
    this.children.push(...children);
  }

  setAttribute(name, value) {
    this.writes += 1;
    this.attributes.set(name, value);
  }

  removeAttribute(name) {
    this.writes += 1;
    this.attributes.delete(name);
  }

  getAttribute(name) {
    return this.attributes.get(name) ?? null;
  }

  getBoundingClientRect() {
    return { left: 100, top: 50, width: 800, height: 600 };
  }

  setPointerCapture() {}
}

globalThis.Element = FakeElement;
globalThis.WheelEvent = { DOM_DELTA_PIXEL: 0 };
const page = new EventTarget();
let dialog = null;
globalThis.window = page;
const colors = new Map();
globalThis.document = Object.assign(new EventTarget(), {
  createElement: (tag) => Object.assign(new FakeElement(tag), { style: {}, remove() {} }),
  createElementNS: (_, tag) => new FakeElement(tag),
  documentElement: new FakeElement('html'),
  querySelector: (selector) => (selector === 'dialog[open]' ? dialog : null),
});
globalThis.getComputedStyle = ({ style }) => ({
  color: colors.get(style?.color?.slice('var(--'.length, -1)) ?? '', fontSize: '18px',
});
page.matchMedia = () => ({ matches: false });

const { HELD_MS } = await import('../../page/cockpit/js/after/restart_key.js');
const { attachKeys } = await import('../../page/cockpit/js/world/keys.js');
const { Keyboard } = await import('../../page/cockpit/js/driving/keyboard.js');
const { attachGestures } = await import('../../page/cockpit/js/world/gestures.js');
const { recall, remember } = await import('../../page/cockpit/js/panels/memory.js');
const { Palette } = await import('../../page/cockpit/js/world/palette.js');
const { element, setAttribute, setText, svg } = await import(
  '../../page/cockpit/js/dom.js');

/** An event as a browser has it; its target is where it is sent unless said otherwise. */
function eventOf(type, values) {
  const event = new Event(type, { cancelable: true });
  for (const [name, value] of Object.entries(values)) {
    Object.defineProperty(event, name, { value, configurable: true });
  }
  return event;
}

const pressed = (key, more) => {
  const event = eventOf('keydown', { key, ...more });
  page.dispatchEvent(event);
  return event;
};

test('keys of the world: each has its action, and none acts while typing or in a dialog', (t) => {
  const done = [];
  const note = (name) => (value) => done.push(value === undefined ? name : [name, value]);
  const end = attachKeys({ zoomBy: note('zoom'), turnBy: note('turn'), fit: note('fit'),
    followNext: note('follow'), toggleHeading: note('heading'), toggleLabels: note('labels') });
  t.after(end);
  for (const key of ['+', '=', '-', '0', 'f', 'H', 'q', 'e', 'L']) {
    assert.ok(pressed(key).defaultPrevented, key);
  }
  assert.deepEqual(done, [['zoom', 1.25], ['zoom', 1.25], ['zoom', 0.8], 'fit', 'follow',
    'heading', ['turn', Math.PI / 12], ['turn', -Math.PI / 12], 'labels']);
  done.length = 0;
  for (const command of ['ctrlKey', 'metaKey', 'altKey']) {
    pressed('f', { [command]: true });
  }
  pressed('f', { target: new FakeElement('textarea') });
  dialog = new FakeElement('dialog');
  pressed('f');
  dialog = null;
  // Driving keys are none of them.
  assert.ok(['w', 'a', 's', 'd', 'r', ' ', 'ArrowUp'].every(
    (key) => !pressed(key).defaultPrevented));
  end();
  pressed('f');
  assert.deepEqual(done, []);
});

function keyboard() {
  const told = { changed: 0, reversed: 0, enabled: true };
  // A second keyboard object would receive the same keys.
  const own = new EventTarget();
  globalThis.window = own;
  const keys = new Keyboard(() => told.enabled, {
    changed: () => { told.changed += 1; }, reversed: () => { told.reversed += 1; } });
  globalThis.window = page;
  const key = (type, code, more) => {
    const event = eventOf(type, { code, key: code, ...more });
    own.dispatchEvent(event);
    return event;
  };
  return { told, keys, down: (code, more) => key('keydown', code, more),
    up: (code) => key('keyup', code) };
}

test('driving keys, by position: throttle, brake, left, right', () => {
  const { keys, told, down, up } = keyboard();
  down('KeyW');
  down('ArrowLeft');
  assert.deepEqual(keys.keys, [1, 0, 1, 0]);
  assert.equal(told.changed, 2);
  down('ArrowUp');
  up('KeyW');
  // The other key of the same action is still held.
  assert.deepEqual(keys.keys, [1, 0, 1, 0]);
  assert.ok(keys.isHeld('ArrowUp') && !keys.isHeld('KeyW'));
  up('ArrowUp');
  up('ArrowLeft');
  down('Space');
  down('KeyD');
  assert.deepEqual(keys.keys, [0, 1, 0, 1]);
  keys.release();
  assert.deepEqual([keys.keys, keys.anyHeld], [[0, 0, 0, 0], false]);
});

test('a repeated key sends nothing new and reaches no widget', () => {
  const { told, down, up } = keyboard();
  down('KeyS');
  assert.ok(down('KeyS', { repeat: true }).defaultPrevented);
  assert.equal(told.changed, 1);
  down('KeyR');
  assert.deepEqual([told.reversed, told.changed], [0, 1]);
  up('KeyR');
  assert.deepEqual([told.reversed, told.changed], [1, 1]);
});

test('a tap on R is the gear, a held R or one with hands off is not', async () => {
  const { told, keys, down, up } = keyboard();
  down('KeyR');
  await new Promise((resolve) => { setTimeout(resolve, HELD_MS + 20); });
  up('KeyR');
  down('KeyR');
  keys.release();
  up('KeyR');
  up('KeyR');
  assert.equal(told.reversed, 0);
});

test('keys drive only while allowed, and never with a command key', () => {
  const { told, keys, down } = keyboard();
  told.enabled = false;
  assert.ok(!down('KeyW').defaultPrevented);
  told.enabled = true;
  for (const more of ['ctrlKey', 'metaKey', 'altKey', 'isComposing']) {
    down('KeyW', { [more]: true });
    assert.equal(keys.anyHeld, false, more);
  }
  down('KeyW', { target: new FakeElement('select') });
  assert.equal(keys.anyHeld, false);
  down('KeyW');
  // macOS reports no release of keys held then.
  down('Meta', { key: 'Meta' });
  assert.equal(keys.anyHeld, false);
});

function canvas() {
  const node = new FakeElement('canvas');
  const done = [];
  attachGestures(node, {
    pan: (...values) => done.push(['pan', ...values]),
    zoom: (...values) => done.push(['zoom', ...values]),
    rotate: (...values) => done.push(['rotate', ...values]),
    pick: (...values) => done.push(['pick', ...values]),
  });
  return { done, send: (type, x, y, more) => node.dispatchEvent(eventOf(type, {
    pointerId: 1, button: 0, shiftKey: false, ...more, clientX: 100 + x, clientY: 50 + y })) };
}

test('dragging pans after a minimum distance', () => {
  const { done, send } = canvas();
  send('pointerdown', 10, 10);
  send('pointermove', 12, 10);
  assert.deepEqual(done, []);
  send('pointermove', 20, 13);
  assert.deepEqual(done, [['pan', 8, 3]]);
  send('pointerup', 20, 13);
  send('pointermove', 90, 90);
  assert.equal(done.length, 1);
});

test('dragging with shift turns about the middle: a quarter from right to top', () => {
  const { done, send } = canvas();
  send('pointerdown', 600, 300, { shiftKey: true });
  send('pointermove', 400, 100);
  const [[action, angle, ...about]] = done;
  assert.equal(action, 'rotate');
  close(angle, Math.PI / 2);
  assert.deepEqual(about, []);
});

test('spreading two fingers by half zooms by half about their middle', () => {
  const { done, send } = canvas();
  send('pointerdown', 300, 300, { pointerId: 1 });
  send('pointerdown', 500, 300, { pointerId: 2 });
  send('pointermove', 600, 300, { pointerId: 2 });
  assert.deepEqual(done, [['pan', 50, 0], ['zoom', 1.5, 450, 300], ['rotate', 0, 450, 300]]);
  done.length = 0;
  // From the right of the other to above it, at equal distance: only a quarter turn.
  send('pointermove', 300, 0, { pointerId: 2 });
  const [[, ...moved], [, factor], [, angle, ...about]] = done;
  close([...moved, factor, angle, ...about], [-150, -150, 1, Math.PI / 2, 300, 150]);
});

test('the wheel zooms at the pointer, a line as 30 pixels; a double click picks', () => {
  const { done, send } = canvas();
  send('wheel', 40, 30, { deltaY: -100, deltaMode: 0 });
  send('wheel', 40, 30, { deltaY: -10, deltaMode: 1 });
  send('dblclick', 7, 8);
  close(done.flatMap(([, ...values]) => values),
    [Math.exp(0.15), 40, 30, Math.exp(0.45), 40, 30, 7, 8]);
});

test('preferences are kept under their own names, and an empty one is removed', () => {
  const kept = keepStorage({ theme: 'of another page' });
  assert.equal(recall('theme'), '');
  remember('theme', 'dark');
  assert.deepEqual([recall('theme'), kept.get('crgame.theme'), kept.get('theme')],
    ['dark', 'dark', 'of another page']);
  remember('theme', '');
  assert.equal(kept.has('crgame.theme'), false);
});

test('where storage is forbidden, a preference lasts as long as the page', (t) => {
  const refuse = () => {
    throw new Error('forbidden');
  };
  const before = page.localStorage;
  t.after(() => Object.assign(page, { localStorage: before }));
  page.localStorage = { getItem: refuse, setItem: refuse, removeItem: refuse };
  remember('theme', 'dark');
  assert.equal(recall('theme'), 'dark');
  remember('theme', '');
  assert.equal(recall('theme'), '');
});

test('colours have the style sheets\' names without map-, and are read again', () => {
  colors.set('map-label-ground', 'rgb(1, 2, 3)').set('av', 'blue').set('map-road', 'grey');
  const palette = Palette.ofTheme();
  assert.deepEqual([palette.labelGround, palette.av, palette.road, palette.rem_px],
    ['rgb(1, 2, 3)', 'blue', 'grey', 18]);
  colors.set('av', 'navy');
  palette.read();
  assert.equal(palette.av, 'navy');
});

test('an element: text as text, true as an empty attribute, false as none', () => {
  let clicked = 0;
  const child = svg('path', { d: 'M0 0' });
  const node = element('button', { class: 'a', text: '<b>', disabled: true, hidden: false,
    title: undefined, 'data-n': 0, on: { click: () => { clicked += 1; } } }, child, null, 'tail');
  assert.equal(node.textContent, '<b>');
  assert.deepEqual([...node.attributes], [['class', 'a'], ['disabled', ''], ['data-n', '0']]);
  assert.deepEqual(node.children, [child, 'tail']);
  node.dispatchEvent(new Event('click'));
  assert.equal(clicked, 1);
});

test('unchanged values are not written again, as each write costs a layout', () => {
  const node = new FakeElement();
  const after = ['a', 'a', 'b', true, true, false, null].map((value) => {
    setAttribute(node, 'data-x', value);
    return [node.getAttribute('data-x'), node.writes];
  });
  assert.deepEqual(after,
    [['a', 1], ['a', 1], ['b', 2], ['', 3], ['', 3], [null, 4], [null, 4]]);
  let written = 0;
  const text = { get textContent() { return 'same'; }, set textContent(_) { written += 1; } };
  setText(text, 'same');
  assert.equal(written, 0);
  setText(text, 'other');
  assert.equal(written, 1);
});
