// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Messages over the world and how long they stay; the question before what cannot be undone. */

import assert from 'node:assert/strict';
import { afterEach, beforeEach, mock, test } from 'node:test';

import { confirm } from '../../page/cockpit/js/panels/confirm.js';
import { createNotices } from '../../page/cockpit/js/panels/notices.js';
import { click, liveStore, openPage, textOf } from './dom_support.mjs';

// The dialog is made once, so all tests have one page.
const body = openPage();
let root, store, notices;

beforeEach(() => {
  mock.timers.enable({ apis: ['setTimeout'] });
  root = document.createElement('div');
  body.append(root);
  store = liveStore([]);
  notices = createNotices(root, store);
});

afterEach(() => {
  mock.timers.reset();
  root.remove();
});

const tell = (level, text) => store.receive({ type: 'notice', level, text });
const texts = () => [...root.children].map((toast) => textOf(toast));

test('an information stays for 5 s, a warning for 9 s, and an error until it is closed',
  async () => {
    tell('info', 'Dora paused the run');
    tell('warn', 'not now');
    tell('error', './panels/title.js failed: no such file');
    assert.deepEqual([...root.children].map((toast) => toast.getAttribute('role')),
      ['status', 'status', 'alert']);
    mock.timers.tick(4999);
    assert.equal(root.children.length, 3);
    mock.timers.tick(1);
    assert.deepEqual(texts(), ['not now', './panels/title.js failed: no such file']);
    mock.timers.tick(4000);
    assert.deepEqual(texts(), ['./panels/title.js failed: no such file']);
    mock.timers.tick(3.6e6);
    assert.equal(root.children.length, 1);
    await click(root.querySelector('[aria-label="Close this message"]'));
    assert.equal(root.children.length, 0);
  });

test('the same message is counted instead of repeated, and stays longer', () => {
  tell('info', 'saved');
  mock.timers.tick(4000);
  tell('info', 'saved');
  tell('info', '  saved\n');
  assert.deepEqual(texts(), ['saved ×3']);
  mock.timers.tick(4999);
  assert.equal(root.children.length, 1);
  mock.timers.tick(1);
  assert.equal(root.children.length, 0);
  tell('info', 'saved');
  assert.deepEqual(texts(), ['saved']);
});

test('the same text at another level is another message', () => {
  tell('info', 'saved');
  tell('warn', 'saved');
  assert.deepEqual([...root.children].map(({ className }) => className),
    ['toast toast-info', 'toast toast-warn']);
});

test('a message that is closed may come again, and has its own time and count', async () => {
  tell('info', 'broken');
  await click(root.querySelector('button'));
  assert.deepEqual(texts(), []);
  mock.timers.tick(2000);
  tell('info', 'broken');
  mock.timers.tick(3000);
  tell('info', 'broken');
  assert.deepEqual(texts(), ['broken ×2']);
});

test('of more than four messages the oldest goes, even an error', () => {
  tell('error', 'first');
  for (const text of ['second', 'third', 'fourth']) {
    tell('info', text);
  }
  assert.deepEqual(texts(), ['first', 'second', 'third', 'fourth']);
  tell('warn', 'fifth');
  assert.deepEqual(texts(), ['second', 'third', 'fourth', 'fifth']);
});

test('a message under the pointer stays, and its time begins anew when the pointer leaves', () => {
  tell('info', 'read me');
  const [toast] = root.children;
  toast.dispatchEvent(new Event('pointerenter'));
  mock.timers.tick(60000);
  assert.equal(root.children.length, 1);
  toast.dispatchEvent(new Event('pointerleave'));
  mock.timers.tick(4999);
  assert.equal(root.children.length, 1);
  mock.timers.tick(1);
  assert.equal(root.children.length, 0);
});

test('parts of the page can show a message too, and an unknown level is an information', () => {
  notices.show('warn', 'the pedal is not found');
  notices.show('constructor', 'of a newer server');
  assert.deepEqual(texts(), ['the pedal is not found', 'of a newer server']);
  assert.ok(root.children[1].classList.contains('toast-info'));
  mock.timers.tick(5000);
  assert.deepEqual(texts(), ['the pedal is not found']);
});

test('a foreign text stays text on one line and turns nothing around', () => {
  tell('error', `<b onclick="x">Bob</b>\r\n\tsays ${'long '.repeat(400)}`);
  tell('error', 'abc \u202etxet');
  assert.equal(root.querySelector('b'), null);
  assert.match(root.children[0].querySelector('.toast-text').textContent,
    /^<b onclick="x">Bob<\/b> says long long .*long$/);
  assert.equal(root.children[1].querySelector('.toast-text').textContent,
    '\u2068abc \u202etxet\u2069');
});

const dialog = () => document.querySelector('dialog');
const answer = (text) => click([...dialog().querySelectorAll('button')].find(
  (button) => button.textContent === text));

test('a question says what follows, and only its verb confirms it', async () => {
  const asked = confirm('End the run?', 'It cannot go on afterwards.', 'End');
  assert.ok(dialog().open);
  assert.equal(textOf(dialog()), 'End the run? It cannot go on afterwards. Cancel End');
  assert.equal(document.getElementById(dialog().getAttribute('aria-labelledby')).textContent,
    'End the run?');
  await answer('End');
  assert.equal(await asked, true);
  assert.ok(!dialog().open);
});

test('Cancel has the focus and declines, also after a question that was confirmed', async () => {
  const first = confirm('Reset the run?', 'It begins anew.', 'Reset');
  await answer('Reset');
  assert.equal(await first, true);
  const second = confirm('Delete <i>run</i>?', 'Its files are lost.', 'Delete');
  assert.equal(document.activeElement.textContent, 'Cancel');
  assert.equal(textOf(dialog()), 'Delete <i>run</i>? Its files are lost. Cancel Delete');
  assert.equal(dialog().querySelector('i'), null);
  await answer('Cancel');
  assert.equal(await second, false);
  assert.equal(document.querySelectorAll('dialog').length, 1);
});

test('a question that Escape closes is declined, also after one that was confirmed', async () => {
  const first = confirm('Reset the run?', 'It begins anew.', 'Reset');
  await answer('Reset');
  assert.equal(await first, true);
  const second = confirm('Reset the run?', 'It begins anew.', 'Reset');
  // Escape closes without a value, so that the former one is kept.
  dialog().removeAttribute('open');
  dialog().dispatchEvent(new Event('close'));
  assert.equal(await second, false);
});
