// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Parts of the desk's pages: breaks, questions for a reason, drafts, and words. */

import assert from 'node:assert/strict';
import { setImmediate as soon } from 'node:timers/promises';
import { beforeEach, test } from 'node:test';

import { breakView, clockTime } from '../../page/desk/js/break_view.js';
import { DeviceCheck } from '../../page/desk/js/device_check.js';
import { Draft, draftName, forgetOtherDrafts } from
  '../../page/desk/js/draft.js';
import { askReason } from '../../page/desk/js/reason_dialog.js';
import { doubtWords, entryWords, kindWords, stateWords, timeOfDay } from
  '../../page/desk/js/session_words.js';
import { Words } from '../../page/desk/js/words.js';
import { shippedWords } from './desk_words.mjs';
import { click, expose, openPage, Pictures, textOf } from './dom_support.mjs';

let root;

beforeEach(() => {
  root = openPage();
  expose('sessionStorage');
});

/** Show a break; `wait` lets time pass, as its timer sees it. */
function rest(t, left_s, text = '') {
  t.mock.timers.enable({ apis: ['setTimeout'] });
  const pictures = new Pictures();
  const words = new Words();
  words.load({ next: 'Next', break: 'Break', break_left: 'Not before {time}',
    break_over: 'Go on whenever you are ready.' }, 'en');
  const done = [];
  const node = breakView({ text, left_s }, words, () => done.push(1));
  root.append(node);
  return { node, done, next: node.querySelector('button'), wait: (ms) => {
    for (let passed = 0; passed < ms; passed += 250) {
      pictures.now_ms += 250;
      t.mock.timers.tick(250);
    }
  } };
}

test('a break counts down, and goes on when its time is over', async (t) => {
  const { node, done, next, wait } = rest(t, 61, 'Stretch <b>out</b>.');
  assert.equal(textOf(node), 'Break Stretch <b>out</b>. Not before 1:01 Next');
  await click(next);
  assert.deepEqual([next.disabled, done], [true, []]);
  wait(1000);
  assert.match(textOf(node), /Not before 1:00 Next/);
  wait(59_500);
  assert.match(textOf(node), /Not before 0:01 Next/);
  assert.ok(next.disabled);
  wait(500);
  assert.equal(textOf(node), 'Break Stretch <b>out</b>. Go on whenever you are ready. Next');
  assert.deepEqual([next.disabled, document.activeElement === next], [false, true]);
  await click(next);
  assert.deepEqual(done, [1]);
});

test('a break that is over is over at once, and takes no focus', (t) => {
  const { node, next } = rest(t, 0);
  assert.equal(textOf(node), 'Break Go on whenever you are ready. Next');
  assert.deepEqual([next.disabled, document.activeElement === next], [false, false]);
});

test('a check of the controls that is left leaves no dialog', () => {
  new Pictures();
  navigator.getGamepads = () => [];
  for (const open of [false, true]) {
    const check = new DeviceCheck({ text: '' }, new Words(), () => {});
    document.querySelector('dialog.calibration').open = open;
    check.end();
    assert.equal(document.querySelector('dialog'), null);
  }
});

test('a break that is left counts no more', (t) => {
  const { node, wait } = rest(t, 10);
  wait(1000);
  node.remove();
  wait(20_000);
  assert.match(textOf(node), /Not before 0:09/);
});

test('seconds are written as a clock', () => {
  assert.deepEqual([0, 9, 60, 61, 605, 3600].map(clockTime),
    ['0:00', '0:09', '1:00', '1:01', '10:05', '60:00']);
});

const dialog = () => root.querySelector('dialog');
const press = (text) => click([...dialog().querySelectorAll('button')].find(
  (button) => button.textContent === text));

/** Ask for a reason; the promise is in an array, so that it is not awaited. */
function ask(...more) {
  return [askReason(shippedWords('en'), 'End <b>it</b>?', 'It cannot be undone.', 'End', ...more)];
}

test('an order with a reason gives the reason, without blanks around it', async () => {
  const [answer] = ask();
  assert.equal(textOf(dialog()), 'End <b>it</b>? It cannot be undone. Reason Cancel End');
  assert.ok(dialog().open);
  assert.equal(dialog().querySelector('input').maxLength, 2000);
  dialog().querySelector('input').value = '  asked <i>elsewhere</i> ';
  await press('End');
  assert.equal(await answer, 'asked <i>elsewhere</i>');
  assert.ok(!dialog());
});

test('without a reason nothing is ordered', async () => {
  const [answer] = ask();
  let told = 'waits';
  answer.then((value) => { told = value; });
  for (const reason of ['', '   ']) {
    dialog().querySelector('input').value = reason;
    await press('End');
    await soon();
    assert.deepEqual([dialog()?.open, told], [true, 'waits']);
  }
  dialog().querySelector('input').value = 'late';
  await press('End');
  assert.equal(await answer, 'late');
});

test('cancelling, also with a reason or by Escape, is a no', async () => {
  for (const end of [() => press('Cancel'), () => dialog().close()]) {
    const [answer] = ask();
    dialog().querySelector('input').value = 'typed';
    await end();
    assert.equal(await answer, null);
    assert.ok(!dialog());
  }
});

test('a question that needs no reason has no field for one', async () => {
  const [answer] = ask(false);
  assert.equal(textOf(dialog()), 'End <b>it</b>? It cannot be undone. Cancel End');
  await press('End');
  assert.equal(await answer, '');
  const [other] = ask(false);
  await press('Cancel');
  assert.equal(await other, null);
});

const DESK = { study: 'S', participant: 'P07', item: 'before/1', again: 0 };

test('a draft keeps the answers, and when they were given, over a reload', () => {
  let now_s = 100;
  const clock = () => now_s;
  new Draft('a', clock).put('tired', null);
  now_s = 103.00049;
  const draft = new Draft('a', clock);
  draft.put('age', 42);
  now_s = 104;
  draft.put('often', ['x']);
  now_s = 110;
  const again = new Draft('a', clock);
  assert.deepEqual(again.answers, { tired: null, age: 42, often: ['x'] });
  assert.deepEqual(again.times(), { shown_at: 100, answered_at: 110, taken_s: 10,
    after_s: { tired: 0, age: 3, often: 4 } });
});

test('a clock that is set back gives no negative times', () => {
  let now_s = 100;
  const draft = new Draft('a', () => now_s);
  now_s = 90;
  draft.put('age', 1);
  const { taken_s, after_s } = draft.times();
  assert.deepEqual([taken_s, after_s], [0, { age: 0 }]);
});

test('a broken draft is begun anew', () => {
  for (const text of ['{', 'null', '7', '{"shown_at": "x", "answers": {}, "after_s": {}}',
    '{"shown_at": 1, "after_s": {}}', '{"shown_at": 1, "answers": {}}']) {
    sessionStorage.setItem('crgame.draft.a', text);
    const draft = new Draft('a', () => 50);
    assert.deepEqual([draft.answers, draft.times().shown_at], [{}, 50], text);
  }
});

test('each item, person and study has its own draft, and so has an item that comes again', () => {
  const names = [DESK, { ...DESK, again: 1 }, { ...DESK, item: 'before/2' },
    { ...DESK, participant: 'P08' }, { ...DESK, study: 'T' }].map(draftName);
  assert.equal(new Set(names).size, names.length);
  assert.equal(draftName({ ...DESK, show: 'page' }), names[0]);
});

test('the drafts of other items are forgotten, and nothing else is', () => {
  const [here, there] = [DESK, { ...DESK, again: 1 }].map(draftName);
  new Draft(here, () => 1).put('age', 42);
  new Draft(there, () => 1);
  sessionStorage.setItem('crgame.desk.page', 'key');
  forgetOtherDrafts(here);
  assert.deepEqual(Object.keys(sessionStorage).toSorted(),
    ['crgame.desk.page', `crgame.draft.${here}`]);
  assert.deepEqual(new Draft(here, () => 9).answers, { age: 42 });
});

const LANGUAGES = ['en', 'de'];

test('entries of the journal are told in one line each, typed text as it was typed', () => {
  const drive = { time_s: 12.34, run: 'run_2' };
  const cases = [
    [{ entry: 'note', item: 'main/1', text: '<i>sleepy</i>', ...drive },
      'note at 12.3 s of run_2: <i>sleepy</i>', 'Notiz bei 12,3 s von run_2: <i>sleepy</i>'],
    [{ entry: 'note', item: '', text: 'late {item}', time_s: null },
      'note: late {item}', 'Notiz: late {item}'],
    [{ entry: 'marker', name: 'spoke', ...drive },
      'marker at 12.3 s of run_2: spoke', 'Marker bei 12,3 s von run_2: spoke'],
    [{ entry: 'marker', name: 'spoke' }, 'marker: spoke', 'Marker: spoke'],
    [{ entry: 'language', language: 'de' }, 'language: de', 'Sprache: de'],
    [{ entry: 'held', held: true },
      'held before the next item', 'vor dem nächsten Schritt angehalten'],
    [{ entry: 'held', held: false }, 'goes on', 'geht weiter'],
    [{ entry: 'begun' }, 'session begun', 'Sitzung begonnen'],
    [{ entry: 'opened' }, 'program started', 'Programm gestartet'],
    [{ entry: 'allocated', group: 'bars', place: 2 },
      'group bars, place 3 in it', 'Gruppe bars, Platz 3 darin'],
    [{ entry: 'ended', reason: 'asked to stop' },
      'session ended: asked to stop', 'Sitzung beendet: asked to stop'],
    [{ entry: 'started', item: 'main/1', attempt: 2, run: 'run_3' },
      'started main/1, attempt 2, run_3', 'main/1 begonnen, Versuch 2, run_3'],
    [{ entry: 'started', item: 'main/1', attempt: 1 },
      'started main/1, attempt 1', 'main/1 begonnen, Versuch 1'],
    [{ entry: 'practised', item: 'p/1', good: true }, 'practised p/1: good', 'p/1 geübt: gut'],
    [{ entry: 'practised', item: 'p/1', good: false },
      'practised p/1: not good', 'p/1 geübt: nicht gut'],
    [{ entry: 'finished', item: 'before/1', answers: { age: 42 } },
      'finished before/1', 'before/1 fertig'],
    [{ entry: 'finished', item: 'main/1', outcome: 'time' },
      'finished main/1: time', 'main/1 fertig: Zeit'],
    [{ entry: 'skipped', item: 'before/2', reason: 'asked' },
      'skipped before/2: asked', 'before/2 ausgelassen: asked'],
    [{ entry: 'repeated', item: 'x', reason: '', outcome: 'y' }, 'repeated x: ', 'x wiederholt: '],
    [{ entry: 'aborted', reason: 'ill' }, 'aborted: ill', 'abgebrochen: ill']];
  for (const [index, language] of LANGUAGES.entries()) {
    const words = shippedWords(language);
    assert.deepEqual(cases.map(([entry]) => entryWords({ at: 1, ...entry }, words)),
      cases.map((told) => told[1 + index]));
  }
});

const RATE = { check: 'view_rate_hz', value: 10, bound: 20, unit: '', digits: 1, least: true };
const AWAY = { check: 'away_s', value: 1.27, bound: 0.5, unit: 's', digits: 1, least: false };
const CYCLES = { check: 'timeout_ratio', value: 12.345, bound: 100 * 0.07, unit: '%', digits: 1,
  least: false };

test('what is beyond a bound is told with the bound, as the journal tells it in English', () => {
  const told = LANGUAGES.map((language) => [RATE, AWAY, CYCLES].map((doubt) => doubtWords(
    doubt, shippedWords(language))));
  assert.deepEqual(told, [
    ['pictures a second 10.0 instead of at least 20',
      'page hidden or without the focus 1.3 s instead of at most 0.5 s',
      'cycles that took longer than a step 12.3 % instead of at most 7 %'],
    ['Bilder in der Sekunde 10,0 statt mindestens 20',
      'Seite verdeckt oder ohne Fokus 1,3 s statt höchstens 0,5 s',
      'Zyklen länger als ein Schritt 12,3 % statt höchstens 7 %']]);
});

test('an item has its kind and its state, with the outcome, the reason or the doubts', () => {
  const row = { outcome: '', reason: '', doubts: [] };
  const rows = [
    [{ ...row, kind: 'drive', what: '3', state: 'finished', outcome: 'time', doubts: [RATE] },
      'drive 3', 'finished: time; pictures a second 10.0 instead of at least 20',
      'Fahrt 3', 'fertig: Zeit; Bilder in der Sekunde 10,0 statt mindestens 20'],
    [{ ...row, kind: 'break', what: '0.5', state: 'skipped', reason: 'not {what}' },
      'break 0.5 min', 'skipped: not {what}', 'Pause 0,5 min', 'ausgelassen: not {what}'],
    [{ ...row, kind: 'fields', what: '', state: 'to_come' },
      'about the participant', 'to come', 'zur Person', 'kommt noch']];
  for (const [index, language] of LANGUAGES.entries()) {
    const words = shippedWords(language);
    assert.deepEqual(rows.map(([shown]) => [kindWords(shown, words), stateWords(shown, words)]),
      rows.map((told) => told.slice(1 + 2 * index, 3 + 2 * index)));
  }
});

test('the time of day has hours to 24, minutes and seconds', () => {
  assert.equal(timeOfDay(new Date(2026, 0, 2, 9, 5, 7).getTime() / 1000), '09:05:07');
  assert.equal(timeOfDay(new Date(2026, 0, 2, 23, 59, 0).getTime() / 1000), '23:59:00');
});
