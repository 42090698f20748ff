// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The parameters in a stage's address, and its texts. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { readStage } from '../../page/cockpit/js/stage/stage_address.js';
import { WORDS } from '../../page/cockpit/js/stage/stage_words.js';
import { readViewWindow } from '../../page/cockpit/js/view3d/view_window.js';

test('an address without a seat is the page with everything', () => {
  assert.equal(readStage(''), null);
  assert.equal(readStage('?view=driver&lang=de'), null);
});

test('defaults show a participant the least', () => {
  assert.deepEqual(readStage('?stage=hv0'), { seat: 'hv0', view: 'driver', map: true,
    names: false, plans: false, sound: true, mirrors: true, change: false, fieldOfView_deg: null,
    corner: null, lang: 'en' });
});

test('the address can set everything; invalid values are ignored', () => {
  assert.deepEqual(readStage('?stage=hv1&view=map&map=0&names=1&plans=1&sound=0&mirrors=0'
    + '&change=1&fov=60&corner=top-left&lang=de'), { seat: 'hv1', view: 'map', map: false,
    names: true, plans: true, sound: false, mirrors: false, change: true, fieldOfView_deg: 60,
    corner: 'top-left', lang: 'de' });
  assert.deepEqual(readStage('?stage=hv0&view=moon&map=no&names=yes&plans=2&fov=900&corner=no'
    + '&lang=xx'), readStage('?stage=hv0'));
});

test('a stage is no side window', () => {
  assert.equal(readViewWindow('?stage=hv0&view=driver'), null);
  assert.equal(readViewWindow('?view=driver')?.viewpoint, 'driver');
});

test('every language has all texts', () => {
  assert.deepEqual(Object.keys(WORDS.de), Object.keys(WORDS.en));
});
