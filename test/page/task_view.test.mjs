// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Lights of detection tasks: when they are on, and the answers that are sent with their times. */

import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { send, textOf } from './dom_support.mjs';
import { ANSWER, CALL, enter, find, LIGHT, MINE, NONE, openTasks, picture, pictures, prompt,
  root, run, seats, sent, store, tasks } from './task_support.mjs';

beforeEach(openTasks);

/** Show a light, the first picture of which is on the screen at 1023 ms. */
async function shine(number = 1) {
  tasks(['light'], prompt(LIGHT, number));
  await picture();
  await picture();
}

test('without tasks nothing is shown, and nothing is drawn in vain', () => {
  assert.ok(['light', 'request', 'frame', 'note', 'answer'].every((name) => find(name).hidden));
  assert.equal(textOf(root.querySelector('#tasks')), '');
  const { waiting } = pictures;
  run('running');
  run('running');
  assert.equal(pictures.waiting, waiting);
  pictures.draw();
  assert.equal(pictures.waiting, 0);
});

test('a light is on from the next picture, and its delays are sent', async () => {
  tasks(['light'], prompt(LIGHT));
  assert.ok(find('light').hidden);
  await picture();
  assert.ok(!find('light').hidden);
  assert.equal(find('light').getAttribute('aria-label'), 'Light');
  assert.deepEqual(sent(), []);
  await picture();
  assert.deepEqual(sent(), [{ ...ANSWER, what: 'shown', number: 1, delay_ms: 33,
    picture_ms: 23 }]);
});

test('an answer is sent with its time from the first picture, and the light goes out',
  async () => {
    await shine();
    sent();
    const event = enter({ timeStamp: 1323 });
    assert.deepEqual(sent(), [{ ...ANSWER, number: 1, delay_ms: 33, picture_ms: 23,
      response_ms: 300, paused_ms: 0 }]);
    assert.ok(event.defaultPrevented);
    await picture();
    assert.ok(find('light').hidden);
    enter();
    assert.deepEqual(sent(), [{ ...ANSWER, number: 0 }], 'there was nothing to answer');
  });

test('a light goes out by itself, and is answered for a while after that', async () => {
  await shine();
  await picture(970);
  assert.ok(!find('light').hidden);
  await picture(10);
  assert.ok(find('light').hidden);
  sent();
  enter({ timeStamp: 3523 });
  assert.equal(sent()[0].response_ms, 2500);
  tasks(['light'], prompt(LIGHT, 2));
  await picture();
  await picture();
  sent();
  enter({ timeStamp: pictures.now_ms + 2500 });
  assert.deepEqual(sent(), [{ ...ANSWER, number: 0 }]);
});

test('in a pause no light is on and no key answers; the pause does not count', async () => {
  await shine();
  sent();
  run('paused');
  await picture();
  assert.ok(find('light').hidden);
  enter();
  assert.deepEqual(sent(), []);
  pictures.now_ms += 5000;
  run('running');
  await picture();
  assert.ok(!find('light').hidden);
  enter();
  const [{ response_ms, paused_ms }] = sent();
  // 1046 - 1023 before the pause, 23 after it.
  assert.deepEqual([response_ms, paused_ms], [46, 5023]);
});

test('a light that was shown before a reload is not shown again', async () => {
  tasks(['light'], prompt(LIGHT, 4, { seen: true }));
  await picture();
  await picture();
  assert.ok(find('light').hidden);
  enter();
  assert.deepEqual(sent(), [{ ...ANSWER, number: 0 }]);
});

test('a light is for the driver of its seat alone, and ends with the seat', async () => {
  seats({ hv0: { ...NONE, holder: 'c2' } });
  await shine();
  enter();
  assert.ok(find('light').hidden && find('answer').hidden);
  assert.deepEqual(sent(), []);
  seats({ hv0: MINE });
  await picture();
  assert.ok(!find('light').hidden);
  store.setConnected(false);
  await picture();
  assert.ok(find('light').hidden);
  enter();
  assert.deepEqual(sent().filter(({ what }) => what === 'answer'), []);
});

test('a light that is over, or of an earlier run, is gone', async () => {
  await shine();
  tasks(['light']);
  await picture();
  assert.ok(find('light').hidden);
  tasks(['light'], prompt(LIGHT, 2));
  await picture();
  assert.ok(!find('light').hidden);
  store.receive({ ...store.scene, type: 'scene', tasks: [CALL] });
  await picture();
  assert.ok(find('light').hidden && find('answer').hidden, 'of another game');
  store.receive({ ...store.scene, type: 'scene', tasks: [LIGHT] });
  await picture();
  assert.ok(!find('light').hidden);
  store.tasks = { running: [], open: [] };
  store.restart(1);
  await picture();
  assert.ok(find('light').hidden);
});

test('keys with another meaning are no answers', async () => {
  await shine();
  sent();
  root.append(document.createElement('input'));
  send(root.querySelector('input'), 'keydown', { key: 'Enter', timeStamp: 1400 });
  for (const more of [{ key: ' ', code: 'Space' }, { ctrlKey: true }, { altKey: true },
    { metaKey: true }]) {
    assert.ok(!enter(more).defaultPrevented);
  }
  assert.ok(enter({ repeat: true }).defaultPrevented);
  root.append(document.createElement('dialog'));
  root.querySelector('dialog').setAttribute('open', '');
  enter();
  assert.deepEqual(sent(), []);
});

test('a touch on the button or the light answers while a detection task goes on', async () => {
  assert.ok(find('answer').hidden);
  await shine();
  assert.ok(!find('answer').hidden);
  sent();
  send(find('light'), 'pointerdown', { timeStamp: 1223 });
  assert.equal(sent()[0].response_ms, 200);
  send(find('answer'), 'pointerdown');
  assert.deepEqual(sent(), [{ ...ANSWER, number: 0 }]);
  tasks([]);
  assert.ok(find('answer').hidden);
  send(find('answer'), 'pointerdown');
  assert.deepEqual(sent(), []);
});

test('a free button of a gamepad answers once for each press', async () => {
  const pad = { index: 0, connected: true, timestamp: 0, buttons: [{ pressed: true },
    { pressed: false }] };
  globalThis.navigator.getGamepads = () => [null, pad];
  const axis = { kind: 'axis', index: 0 };
  globalThis.window.crgame.driving.gamepads.devices = [{ index: 0, profile: { throttle: axis,
    brake: axis, steering: axis, reverse: { on: [], off: [], toggle: [], held: [] },
    put_back: [],
    lights: { left_indicator: [1], right_indicator: [], hazard: [], horn: [] } } }];
  await shine();
  sent();
  pad.buttons = [{ pressed: false }, { pressed: true }];
  await picture();
  assert.deepEqual(sent(), [], 'the button of the indicator');
  pad.buttons = [{ pressed: true }, { pressed: true }];
  pad.timestamp = pictures.now_ms + 15;
  const { timestamp } = pad;
  await picture();
  await picture();
  const told = sent();
  assert.deepEqual([told.length, told[0].response_ms], [1, timestamp - 1023]);
});
