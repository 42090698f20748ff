// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The key that begins a run anew when it is held: its hint, its order, and who may use it. */

import assert from 'node:assert/strict';
import { setImmediate as soon } from 'node:timers/promises';
import { test } from 'node:test';

import { createRestart, HELD_MS } from '../../page/cockpit/js/after/restart_key.js';
import { liveStore, openPage, RIGHTS, send, Server } from './dom_support.mjs';

let root, store;

/** Listen to R in a page of a running game. */
function begins(t) {
  t.mock.timers.enable({ apis: ['setTimeout'] });
  root = openPage();
  store = liveStore([]);
  const server = new Server();
  store.receive({ type: 'status', run: 'running', n: 5, epoch: 0 });
  const state = createRestart(root, store, server);
  const { window } = globalThis;
  const shown = () => {
    const hint_ = root.querySelector('.restart-hint');
    return hint_.hidden ? '' : hint_.textContent;
  };
  return { server, state, shown,
    down: (more) => send(window, 'keydown', { code: 'KeyR', ...more }),
    up: (code = 'KeyR') => send(window, 'keyup', { code }), blur: () => send(window, 'blur'),
    wait: (ms) => t.mock.timers.tick(ms) };
}

test('R held for long begins the run anew, once, and says so before', async (t) => {
  const r = begins(t);
  r.down();
  assert.deepEqual([r.shown(), r.state.held], ['', true]);
  r.wait(249);
  assert.equal(r.shown(), '');
  r.wait(1);
  assert.equal(r.shown(), 'Hold R to begin anew');
  r.down({ repeat: true });
  r.wait(HELD_MS - 251);
  assert.deepEqual(r.server.take(), []);
  r.wait(1);
  assert.deepEqual(r.server.take(), [{ type: 'control', action: 'reset' }]);
  assert.deepEqual([r.shown(), r.state.held], ['', false]);
  r.wait(5000);
  assert.deepEqual(r.server.take(), []);
});

test('R let go early, or a page that is left, begins nothing', (t) => {
  const r = begins(t);
  for (const end of [r.up, r.blur]) {
    r.down();
    r.wait(400);
    r.up('KeyW');
    assert.ok(r.shown() && r.state.held, 'another key does not end it');
    end();
    assert.deepEqual([r.shown(), r.state.held], ['', false]);
    r.wait(5000);
    assert.deepEqual(r.server.take(), []);
  }
});

test('who may not begin anew is told why; a refusal of the server is a notice', async (t) => {
  const r = begins(t);
  const notices = [];
  store.on('notice', ({ level, text }) => notices.push([level, text]));
  r.server.reply = { ok: false, text: 'not now' };
  r.down();
  r.wait(HELD_MS);
  await soon();
  assert.deepEqual(notices, [['warn', 'not now']]);
  r.up();
  r.server.take();
  store.receive({ type: 'you', rights: RIGHTS.drive });
  r.down();
  r.wait(5000);
  assert.equal(r.shown(), 'Only a director can reset the run; you are a driver.');
  assert.ok(root.querySelector('.restart-hint').hasAttribute('data-refused'));
  assert.deepEqual(r.server.take(), []);
});

test('R is left to texts, dialogs, shortcuts, recordings and a page without a run', (t) => {
  const r = begins(t);
  const held = (more) => {
    r.down(more);
    const { held: counts } = r.state;
    r.up();
    return counts;
  };
  const field = document.createElement('textarea');
  assert.ok(held());
  for (const more of [{ target: field }, { ctrlKey: true }, { metaKey: true }, { altKey: true },
    { code: 'KeyT' }]) {
    assert.ok(!held(more), JSON.stringify(more));
  }
  store.setConnected(false);
  assert.ok(!held());
  store.setConnected(true);
  const open = document.createElement('dialog');
  open.setAttribute('open', '');
  root.append(open);
  assert.ok(!held());
  open.remove();
  assert.ok(held());
  store.receive({ type: 'hello', client: 'c1', name: 'Ada', mode: 'replay', version: '1' });
  assert.ok(!held());
});
