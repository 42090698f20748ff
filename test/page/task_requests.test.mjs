// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Requests to take over, with their tone, and the notes of secondary tasks. */

import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { click, RIGHTS, send, textOf } from './dom_support.mjs';
import { begin, CALL, claimed, enter, find, LIGHT, MINE, NONE, openTasks, picture, prompt,
  RADIO, root, seats, sent, store, tasks, tones } from './task_support.mjs';

beforeEach(openTasks);

test('a request is shown to everybody who may take the AV, and taken by key or button',
  async () => {
    seats({});
    tasks([], prompt(CALL));
    await picture();
    await picture();
    assert.equal(textOf(find('request')),
      'Take over Road <b>works</b> Hands on the controls: Enter or this button Take over');
    assert.equal(find('request').getAttribute('role'), 'alert');
    assert.equal(sent()[0].what, 'shown');
    enter();
    await click(find('take'));
    assert.deepEqual(claimed, ['av0', 'av0']);
    assert.deepEqual(sent(), []);
    seats({ av0: MINE });
    await picture();
    assert.equal(textOf(find('request')), 'Take over Road <b>works</b> Drive yourself now');
    enter();
    assert.equal(claimed.length, 2);
    tasks([]);
    await picture();
    assert.ok(find('request').hidden && find('frame').hidden);
  });

test('a request is not shown to drivers of other vehicles, nor to who may not take it',
  async () => {
    tasks([], prompt(CALL));
    for (const [rights, held] of [[RIGHTS.drive, { hv0: MINE }], [RIGHTS.watch, {}],
      [{ ...RIGHTS.drive, seat: 'hv0' }, {}],
      [RIGHTS.drive, { av0: { ...NONE, holder: 'c2' } }]]) {
      store.receive({ type: 'you', rights });
      seats(held);
      await picture();
      assert.ok(find('request').hidden, JSON.stringify([rights, held]));
    }
    store.receive({ type: 'you', rights: { ...RIGHTS.drive, seat: 'av0' } });
    seats({});
    await picture();
    assert.ok(!find('request').hidden);
  });

test('a request without a label has no empty line', async () => {
  begin({ tasks: [{ ...CALL, label: '' }] });
  seats({});
  tasks([], prompt(CALL));
  await picture();
  assert.ok(find('label').hidden && !find('request').hidden);
});

test('a request sounds after a first gesture, until it is taken', async () => {
  const ask = async (number, more) => {
    seats({});
    tasks([], prompt(CALL, number, more));
    await picture();
    return tones.splice(0);
  };
  assert.equal((await ask(1)).length, 0, 'the browser does not allow it yet');
  send(globalThis.window, 'pointerdown');
  const beeps = await ask(2);
  assert.deepEqual(beeps.map(({ pitch }) => pitch), [880, 1320, 880, 1320, 880, 1320]);
  assert.equal(Math.max(...tones.loudest), 0.5 * 0.4);
  tasks([]);
  await picture();
  assert.ok(beeps.every(({ ends }) => ends.length === 2 && ends[1] === undefined));
  assert.equal((await ask(3, { seen: true })).length, 0, 'it sounded before a reload');
  globalThis.window.crgame.sound.volume = 0;
  assert.equal((await ask(4)).length, 0);
  globalThis.window.crgame.sound.volume = 1;
  store.scene.sound = 'none';
  assert.equal((await ask(5)).length, 0);
});

test('the notes are those of the own active tasks that are to be read', () => {
  begin({ tasks: [RADIO, { ...RADIO, name: 'map', label: '' }, { ...RADIO, name: 'secret',
    show: false }, { ...RADIO, name: 'other', seat: 'av0' }, LIGHT] });
  tasks(['radio', 'secret', 'other', 'light']);
  assert.equal(textOf(find('note')), 'Task: Radio');
  tasks(['radio', 'map']);
  assert.equal(textOf(find('note')), 'Task: Radio · Task: map');
  store.setConnected(false);
  assert.ok(find('note').hidden);
  store.setConnected(true);
  tasks([]);
  assert.ok(find('note').hidden);
});

test('the texts are in the language of the game, or that of the address', () => {
  begin({ language: 'de', tasks: [RADIO] });
  tasks(['radio']);
  assert.deepEqual([textOf(find('note')), find('answer').textContent, find('take').textContent,
    root.querySelector('#tasks').lang], ['Aufgabe: Radio', 'Antworten', 'Übernehmen', 'de']);
  globalThis.window.happyDOM.setURL('http://127.0.0.1:8080/?lang=en');
  store.receive({ ...store.scene, type: 'scene' });
  assert.deepEqual([find('take').textContent, root.querySelector('#tasks').lang],
    ['Take over', 'en']);
});

test('a recording and a page without an id show nothing', async () => {
  tasks(['light', 'radio'], prompt(LIGHT));
  store.receive({ type: 'hello', client: 'c1', name: 'Ada', mode: 'replay', version: '1' });
  store.receive({ type: 'seats', seats: store.seats });
  await picture();
  assert.ok(['light', 'note', 'request', 'answer'].every((name) => find(name).hidden));
});

test('who rides in an AV answers its lights by one key, and takes over by another', async () => {
  const light = { ...LIGHT, seat: 'av0' };
  begin({ tasks: [light, { ...CALL, key: 'KeyT' }] });
  store.receive({ type: 'you', rights: { ...RIGHTS.drive, seat: 'av0' } });
  seats({});
  tasks(['light'], prompt(light), prompt(CALL));
  await picture();
  await picture();
  assert.ok(!find('light').hidden && !find('request').hidden && !find('answer').hidden);
  assert.match(textOf(find('request')), /Hands on the controls: T or this button/);
  sent();
  enter();
  assert.deepEqual(sent().map(({ task, seat, what }) => [task, seat, what]),
    [['light', 'av0', 'answer']]);
  assert.deepEqual(claimed, [], 'a press for the light takes nothing over');
  send(document.body, 'keydown', { key: 't', code: 'KeyT' });
  assert.deepEqual([claimed, sent()], [['av0'], []]);
  // Others do not see the lights of a seat that is not theirs.
  store.receive({ type: 'you', rights: RIGHTS.drive });
  await picture();
  await picture();
  assert.ok(find('light').hidden);
});

test('the corner for a photodiode is white in the pictures that hold a stimulus', async () => {
  globalThis.window.crgame.stage = { address: { seat: 'hv0', corner: 'top-right' } };
  begin({});
  const lit = () => find('corner').classList.contains('lit');
  tasks(['light']);
  await picture();
  assert.ok(!find('corner').hidden && !lit());
  assert.equal(find('corner').dataset.corner, 'top-right');
  tasks(['light'], prompt(LIGHT));
  await picture();
  assert.deepEqual([find('light').hidden, lit()], [false, true]);
  await picture(1100);
  await picture();
  assert.deepEqual([find('light').hidden, lit()], [true, false]);
  globalThis.window.crgame.stage.address.corner = null;
  await picture();
  assert.ok(find('corner').hidden);
});
