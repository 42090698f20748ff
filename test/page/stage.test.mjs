// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The parameters in a stage's address, and its language. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { liveStore, openPage, Server, textOf } from './dom_support.mjs';
import { createStage } from '../../page/cockpit/js/stage/stage.js';
import { readStage } from '../../page/cockpit/js/stage/stage_address.js';
import { readViewWindow } from '../../page/cockpit/js/view3d/view_window.js';

test('an address without a seat is the page with everything', () => {
  assert.equal(readStage(''), null);
  assert.equal(readStage('?view=driver&lang=de'), null);
});

test('defaults show a participant the least', () => {
  assert.deepEqual(readStage('?stage=hv0'), { seat: 'hv0', view: 'driver', map: true,
    names: false, plans: false, sound: true, mirrors: true, change: false, fieldOfView_deg: null,
    corner: null });
});

test('the address can set everything; invalid values are ignored', () => {
  assert.deepEqual(readStage('?stage=hv1&view=map&map=0&names=1&plans=1&sound=0&mirrors=0'
    + '&change=1&fov=60&corner=top-left'), { seat: 'hv1', view: 'map', map: false,
    names: true, plans: true, sound: false, mirrors: false, change: true, fieldOfView_deg: 60,
    corner: 'top-left' });
  assert.deepEqual(readStage('?stage=hv0&view=moon&map=no&names=yes&plans=2&fov=900&corner=no'),
  readStage('?stage=hv0'));
});

test('a stage is no side window', () => {
  assert.equal(readViewWindow('?stage=hv0&view=driver'), null);
  assert.equal(readViewWindow('?view=driver')?.viewpoint, 'driver');
});

test('the line has the language of the address, else of the game that is run', (t) => {
  t.mock.timers.enable({ apis: ['setInterval'] });
  const root = openPage('<div class="pedal-brake"><span class="bar-label"></span></div>');
  globalThis.window.crgame = { world: { stats: { frames: 0 } } };
  const store = liveStore([]);
  const shown = (query) => {
    globalThis.window.location.search = query;
    createStage(root, store, new Server());
    store.receive({ type: 'seats', seats: {} });
    return [root.lastElementChild, document.querySelector('.bar-label')].map(textOf).concat(
      document.documentElement.lang);
  };
  const de = ['Dieses Fahrzeug gibt es in dieser Fahrt nicht.', 'Bremse', 'de'];
  const en = ['This run has no such vehicle.', 'Brake', 'en'];
  assert.deepEqual([shown('?stage=hv0'), shown('?stage=hv0&lang=de')], [en, de]);
  store.receive({ ...store.scene, type: 'scene', language: 'de' });
  assert.deepEqual([shown('?stage=hv0'), shown('?stage=hv0&lang=en')], [de, en]);
});
