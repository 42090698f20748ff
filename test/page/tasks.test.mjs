// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Tasks: the time on screen without pauses, the answering buttons, languages. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { answeredBy, isTaken, keyName } from '../../page/cockpit/js/tasks/answers.js';
import { Prompt, RunningTime } from '../../page/cockpit/js/tasks/prompt.js';
import { labelsOf, languageOf, WORDS } from '../../page/cockpit/js/driver_words.js';

/** @import { GameTask } from '../../page/cockpit/js/tasks/task_messages.js' */

/** @type {GameTask} */
const LIGHT = { name: 'light', kind: 'detection_response', label: '', seat: 'hv0', shown_s: 1,
  latest_s: 2.5, lead_s: null, show: true, key: 'Enter', button: null };

/** @param {RunningTime} running */
function drawn(running) {
  const prompt = new Prompt({ task: 'light', seat: 'hv0', number: 1, n: 300, seen: false }, LIGHT,
    running, 10_000, 20);
  prompt.draw(10_030);
  prompt.picture_ms = 16;
  return prompt;
}

test('a response is timed from the first picture, its delay from the message', () => {
  const prompt = drawn(new RunningTime());
  assert.deepEqual(prompt.times(10_380),
    { delay_ms: 40, picture_ms: 16, response_ms: 350, paused_ms: 0 });
  assert.deepEqual(prompt.times(), { delay_ms: 40, picture_ms: 16 });
});

test('the light is on for its time; an answer is accepted for longer', () => {
  const prompt = drawn(new RunningTime());
  assert.deepEqual([10_029, 10_030, 11_029, 11_030].map((at) => prompt.lit(at)),
    [true, true, true, false]);
  assert.deepEqual([10_029, 10_030, 12_530, 12_531].map((at) => prompt.accepts(at)),
    [false, true, true, false]);
  prompt.answered = true;
  assert.equal(prompt.lit(10_100) || prompt.accepts(10_100), false);
});

test('no answer is accepted before the light is drawn', () => {
  const prompt = new Prompt({ task: 'light', seat: 'hv0', number: 1, n: 300, seen: false }, LIGHT,
    new RunningTime(), 10_000, NaN);
  assert.equal(prompt.accepts(10_500) || prompt.lit(10_500), false);
});

test('pauses count neither for the light nor for the response', () => {
  const running = new RunningTime();
  running.note(false, 0);
  running.note(true, 5000);
  const prompt = drawn(running);
  running.note(false, 10_230);
  running.note(false, 12_000);
  assert.equal(prompt.since(99_000), 200);
  assert.equal(prompt.lit(10_500), false);
  running.note(true, 60_230);
  running.note(true, 60_240);
  assert.equal(prompt.lit(60_300), true);
  assert.deepEqual(prompt.times(60_330),
    { delay_ms: 40, picture_ms: 16, response_ms: 300, paused_ms: 50_000 });
});

test('all buttons answer but those that steer, shift, blink or put back', () => {
  /** @type {(index: number) => object} */
  const axis = (index) => ({ kind: 'axis', index, min: 0, max: 1, deadzone: 0 });
  /** @type {any} */
  const profile = { throttle: { ...axis(7), kind: 'button' }, brake: axis(2),
    steering: axis(0), reverse: { on: [3], off: [], toggle: [], held: [4] },
    lights: { left_indicator: [5], right_indicator: [6], hazard: [], horn: [0] },
    put_back: [8] };
  assert.deepEqual(Array.from({ length: 10 }, (_, i) => i).filter((i) => !isTaken(profile, i)),
    [1, 2, 9]);
  const usual = { key: 'Enter', button: null };
  const by = (inputs) => Array.from({ length: 10 }, (_, i) => answeredBy(inputs, profile, i));
  const answers = (inputs, what) => by(inputs).flatMap((each, i) => (each === what ? [i] : []));
  assert.deepEqual(answers({ light: usual }, 'light'), [1, 2, 9]);
  assert.deepEqual(answers({ request: usual }, 'request'), [1, 2, 9]);
  const both = { light: usual, request: usual };
  assert.deepEqual([answers(both, 'light'), answers(both, 'request')], [[1], [2, 9]]);
  const named = { light: { ...usual, button: 9 }, request: usual };
  assert.deepEqual([answers(named, 'light'), answers(named, 'request')], [[9], [1, 2]]);
  const asked = { light: usual, request: { ...usual, button: 1 } };
  assert.deepEqual([answers(asked, 'light'), answers(asked, 'request')], [[2], [1]]);
  assert.deepEqual(by({ light: { ...usual, button: 0 } }), Array(10).fill(null));
  assert.deepEqual(['KeyT', 'Digit1', 'Numpad0', 'Enter'].map(keyName),
    ['T', '1', 'Numpad 0', 'Enter']);
});

test('the language is that of the address, else of the game, else English', () => {
  assert.equal(languageOf('?lang=de', 'en'), 'de');
  assert.equal(languageOf('?lang=de-AT', undefined), 'de');
  assert.equal(languageOf('?lang=xx', 'de'), 'de');
  assert.equal(languageOf('', 'fr'), 'en');
  assert.equal(languageOf('?lang=xx', undefined), 'en');
  assert.deepEqual(Object.keys(WORDS.de), Object.keys(WORDS.en));
});

test('the address has labels of tasks in the language of the driver, or none', () => {
  const query = `?labels=${encodeURIComponent(JSON.stringify({ radio: 'Radio – <b>', odd: 7 }))}`;
  assert.deepEqual([...labelsOf(query)], [['radio', 'Radio – <b>']]);
  for (const other of ['', '?labels=', '?labels=nonsense', '?labels=null', '?labels=7']) {
    assert.equal(labelsOf(other).size, 0, other);
  }
});
