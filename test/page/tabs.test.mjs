// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The tabs of the panels, what is remembered of them, and the focus after a click. */

import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { recall, remember } from '../../page/cockpit/js/panels/memory.js';
import { addPanels, createTabs } from '../../page/cockpit/js/panels/tabs.js';
import { click, openPage, send } from './dom_support.mjs';

const NAMES = ['drive', 'history', 'scenario', 'events', 'criticality', 'timing', 'runs'];
const PAGE = `<div id="bar-end"></div><aside id="panels"><div id="tabs" role="tablist"></div>
  </aside><p id="else">text</p>`;

const find = (selector) => document.querySelector(selector);
let root, panels;

beforeEach(() => {
  openPage(PAGE);
  addPanels(find('#panels'));
  const button = document.createElement('button');
  button.id = 'in-drive';
  find('#panel-drive').append(button);
});

/** Open the page with what it has remembered. */
function begin(kept = {}) {
  for (const [name, value] of Object.entries(kept)) {
    remember(name, value);
  }
  root = find('#panels');
  panels = createTabs(root);
}

const shown = () => NAMES.filter((name) => !find(`#panel-${name}`).hidden);
const selected = () => NAMES.filter(
  (name) => find(`#tab-${name}`).getAttribute('aria-selected') === 'true');
const width = () => document.documentElement.style.getPropertyValue('--panel-width');

test('one panel is shown at a time, and its tab is selected', async () => {
  begin();
  assert.deepEqual([shown(), selected(), panels.current], [['drive'], ['drive'], 'drive']);
  assert.deepEqual([...find('#tabs').children].map(({ textContent }) => textContent),
    ['Drive', 'History', 'Scenario', 'Events', 'Criticality', 'Timing', 'Runs']);
  await click(find('#tab-events'));
  assert.deepEqual([shown(), selected(), panels.current], [['events'], ['events'], 'events']);
  panels.show('runs');
  assert.deepEqual([shown(), selected(), panels.current], [['runs'], ['runs'], 'runs']);
});

test('each tab and its panel name each other', () => {
  begin();
  for (const name of NAMES) {
    assert.equal(find(`#tab-${name}`).getAttribute('aria-controls'), `panel-${name}`);
    assert.equal(find(`#panel-${name}`).getAttribute('aria-labelledby'), `tab-${name}`);
  }
});

test('the panel shown last is shown at the next visit, an unknown one is not', async () => {
  begin();
  await click(find('#tab-timing'));
  assert.equal(recall('panel'), 'timing');
  find('#tabs').replaceChildren();
  begin();
  assert.deepEqual(shown(), ['timing']);
  find('#tabs').replaceChildren();
  begin({ panel: '<b>no</b>' });
  assert.deepEqual([shown(), recall('panel')], [['drive'], 'drive']);
});

test('the panels are hidden by a button, come back with a tab, and this is remembered',
  async () => {
    begin();
    const button = find('#collapse');
    const state = () => [root.hidden, button.getAttribute('aria-expanded'), recall('collapsed')];
    assert.deepEqual(state(), [false, 'true', 'no']);
    await click(button);
    assert.deepEqual(state(), [true, 'false', 'yes']);
    await click(button);
    assert.deepEqual(state(), [false, 'true', 'no']);
    await click(button);
    await click(find('#tab-history'));
    assert.deepEqual(state(), [false, 'true', 'no']);
    assert.deepEqual(shown(), ['history']);
  });

test('panels that were hidden at the last visit are hidden', () => {
  begin({ collapsed: 'yes' });
  assert.ok(root.hidden);
  // Another part shows a panel, which does not open them.
  panels.show('events');
  assert.ok(root.hidden);
});

test('the width follows the drag of its handle, within limits, until a double click', () => {
  begin();
  globalThis.window.innerWidth = 2000;
  document.documentElement.style.fontSize = '16px';
  const handle = find('#panels-handle');
  let captured = null;
  handle.setPointerCapture = (pointer) => { captured = pointer; };
  handle.hasPointerCapture = (pointer) => captured === pointer;
  const drag = (clientX) => send(handle, 'pointermove', { pointerId: 3, clientX });
  drag(1400);
  assert.equal(width(), '', 'not pressed yet');
  assert.ok(send(handle, 'pointerdown', { pointerId: 3 }).defaultPrevented);
  drag(1400);
  assert.deepEqual([width(), recall('width')], ['37.5rem', '37.5']);
  drag(1990);
  assert.equal(width(), '22.0rem');
  drag(10);
  assert.equal(width(), '75.0rem');
  send(handle, 'dblclick');
  assert.deepEqual([width(), recall('width')], ['', '']);
});

test('the width of the last visit is used, nonsense is not', () => {
  globalThis.window.innerWidth = 2000;
  document.documentElement.style.fontSize = '16px';
  begin({ width: '40' });
  assert.equal(width(), '40.0rem');
  document.documentElement.style.removeProperty('--panel-width');
  find('#tabs').replaceChildren();
  begin({ width: 'wide' });
  assert.equal(width(), '');
});

test('a click with the mouse leaves the keys to the car, one by the keyboard the focus', () => {
  begin();
  const button = find('#in-drive');
  const press = (detail) => {
    button.focus();
    send(button, 'click', { detail });
    return document.activeElement === button;
  };
  assert.equal(press(1), false);
  assert.equal(press(0), true);
});

test('a text field keeps the focus when it is clicked', () => {
  begin();
  const field = document.createElement('input');
  root.append(field);
  field.focus();
  send(field, 'click', { detail: 1 });
  assert.ok(document.activeElement === field);
  field.setAttribute('type', 'checkbox');
  send(field, 'click', { detail: 1 });
  assert.ok(document.activeElement !== field);
});

test('a choice made with the mouse gives up the focus, one made by keys does not', () => {
  begin();
  const select = document.createElement('select');
  root.append(select);
  const change = () => {
    select.focus();
    send(select, 'change');
    return document.activeElement === select;
  };
  assert.equal(change(), true);
  send(select, 'pointerdown');
  assert.equal(change(), false);
  send(select, 'keydown', { key: 'ArrowDown' });
  assert.equal(change(), false, 'the list that the mouse has opened');
  send(select, 'keydown', { key: 'Tab' });
  assert.equal(change(), true);
});

test('a preference is kept under the name of the page, and an empty one is forgotten', () => {
  assert.equal(recall('theme'), '');
  remember('theme', 'dark');
  assert.equal(localStorage.getItem('crgame.theme'), 'dark');
  assert.equal(recall('theme'), 'dark');
  remember('theme', '');
  assert.deepEqual([recall('theme'), localStorage.getItem('crgame.theme')], ['', null]);
});

test('where nothing is kept, the panel shown last is known until the page closes', async () => {
  Object.defineProperty(globalThis.window, 'localStorage', {
    get() { throw new Error('SecurityError'); }, configurable: true });
  begin({ panel: 'timing' });
  assert.deepEqual([recall('panel'), shown()], ['timing', ['timing']]);
  await click(find('#tab-runs'));
  await click(find('#collapse'));
  assert.deepEqual([shown(), root.hidden], [['runs'], true]);
});
