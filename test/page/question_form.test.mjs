// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Questions of the desk: every kind of answer, refusals, drafts, and what is sent. */

import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { Draft } from '../../page/desk/js/draft.js';
import { holds, questionForm } from '../../page/desk/js/question_form.js';
import { Words } from '../../page/desk/js/words.js';
import { click, expose, openPage, send, textOf } from './dom_support.mjs';

const TABLE = { next: 'Next', missing: 'Please answer', missing_one: 'One is missing',
  missing_some: '{count} are missing', optional: 'may be left out',
  several: 'Several are possible', slider_unset: 'not marked yet',
  number_wrong: 'From {low} to {high}', number_whole: 'Whole, from {low} to {high}',
  number_low: 'At least {low}', number_whole_high: 'Whole, at most {high}',
  number_any: 'A number', number_any_whole: 'A whole number',
  text_long: '{longest} at most; these are {count}' };
const asked = (kind, more) => ({ name: kind, kind, ask: `What of ${kind}?`, required: true,
  when: null, ...more });
const LIKERT = asked('likert', { points: 5, left: 'never', right: 'always', labels: [] });
const SLIDER = asked('slider', { low: 0, high: 100, step: 5, left: 'awake', right: 'tired' });
const CHOICE = asked('choice', { several: false, choices: [['yes', 'Yes'], ['no', 'No, <b>']] });
const SEVERAL = { ...CHOICE, several: true };
const NUMBER = asked('number', { low: 18, high: 99, whole: true, unit: 'years' });
const TEXT = asked('text', { longest: 10 });
const ALL = [LIKERT, SLIDER, CHOICE, NUMBER, TEXT];

let root, words, now_s, told;

beforeEach(() => {
  root = openPage();
  expose('sessionStorage', 'HTMLTextAreaElement');
  words = new Words();
  words.load(TABLE, 'en');
  [now_s, told] = [1000, []];
});

/** Show questions, with the draft of this tab. */
function ask(...questions) {
  const shown = { title: '', text: '', questions };
  root.replaceChildren(questionForm(shown, words, new Draft('d', () => now_s),
    (answers) => told.push(answers)));
}

const find = (selector) => root.querySelector(selector);
const question = (name) => find(`[data-name="${name}"]`);
const inputs = (name) => [...question(name).querySelectorAll('input, textarea')];
const problem = (name) => textOf(question(name).querySelector('.problem'));
const summary = () => find('form > .problem').textContent;
const goOn = () => click(find('button[type=submit]'));
const type = (name, text) => {
  inputs(name)[0].value = text;
  send(inputs(name)[0], 'input');
};

/** Go on with a typed text; return the answer that is sent, or the refusal. */
async function given(name, text) {
  type(name, text);
  await goOn();
  const [finished] = told.splice(0);
  return finished ? finished.answers[name] : problem(name);
}

test('the questions are asked in their order, below their title and text', () => {
  root.append(questionForm({ title: '<i>About you</i>', text: 'Take your time.',
    questions: [TEXT, { ...NUMBER, required: false }] }, words, new Draft('d', () => 0),
  () => {}));
  assert.equal(textOf(root), '<i>About you</i> Take your time. What of text? What of number? '
    + '(may be left out) years Next');
  assert.ok(!root.querySelector('i'));
});

test('all answers are sent with their times', async () => {
  ask(...ALL);
  now_s = 1002;
  await click(inputs('likert')[3]);
  now_s = 1005.5;
  await click(inputs('likert')[2]);
  type('slider', '35');
  await click(inputs('choice')[1]);
  type('number', '42');
  now_s = 1007;
  type('text', ' so ');
  now_s = 1010;
  await goOn();
  assert.deepEqual(told, [{
    answers: { likert: 3, slider: 35, choice: 'no', number: 42, text: ' so ' },
    shown_at: 1000, answered_at: 1010, taken_s: 10,
    after_s: { likert: 5.5, slider: 5.5, choice: 5.5, number: 5.5, text: 7 } }]);
});

test('a missing answer is told at its question, which gets the focus', async () => {
  ask(...ALL);
  assert.ok(send(find('form'), 'submit').defaultPrevented, 'the page is not left');
  await click(inputs('likert')[0]);
  type('text', 'x');
  await goOn();
  assert.deepEqual(told, []);
  assert.deepEqual(ALL.map(({ name }) => problem(name)),
    ['', 'Please answer', 'Please answer', 'Please answer', '']);
  assert.equal(summary(), '3 are missing');
  assert.ok(document.activeElement === inputs('slider')[0]);
  assert.deepEqual(ALL.map(({ name }) => inputs(name)[0].getAttribute('aria-invalid')),
    [null, 'true', 'true', 'true', null]);
  type('slider', '5');
  assert.equal(problem('slider'), '', 'the error goes with the answer');
  await click(inputs('choice')[0]);
  await goOn();
  assert.deepEqual([summary(), problem('choice'), problem('number')],
    ['One is missing', '', 'Please answer']);
  type('number', '17');
  assert.equal(problem('number'), 'Whole, from 18 to 99', 'another error takes its place');
  type('number', '18');
  await goOn();
  assert.deepEqual([summary(), told.length], ['', 1]);
});

test('what may be left out is left out', async () => {
  const optional = [...ALL, { ...SEVERAL, name: 'several' }].map(
    (each) => ({ ...each, required: false }));
  ask(...optional);
  await goOn();
  assert.deepEqual(told[0].answers, { likert: null, slider: null, choice: null, number: null,
    text: null, several: [] });
  assert.deepEqual(told[0].after_s, {});
});

test('a wrong answer is refused also where it may be left out', async () => {
  ask({ ...NUMBER, required: false });
  assert.equal(await given('number', '17'), 'Whole, from 18 to 99');
  assert.equal(await given('number', ''), null);
});

test('a whole number within its limits', async () => {
  ask(NUMBER);
  const refused = 'Whole, from 18 to 99';
  const found = [];
  for (const text of ['17', '100', '42.5', '-42', 'abc', '4 2', '0x20', 'Infinity', '42', ' 18 ',
    '99', '4.2e1', '42,0', '+42']) {
    found.push(await given('number', text));
  }
  assert.deepEqual(found, [...Array(8).fill(refused), 42, 18, 99, 42, 42, 42]);
  assert.equal(inputs('number')[0].inputMode ?? inputs('number')[0].getAttribute('inputmode'),
    'numeric');
});

test('a number with a fraction takes a comma or a point', async () => {
  ask({ ...NUMBER, low: -1, high: 1.5, whole: false });
  const found = [];
  for (const text of ['0,5', '.5', '1.5', '-1', '-1.01', '1,51', '1.2.3', '1e400']) {
    found.push(await given('number', text));
  }
  assert.deepEqual(found, [0.5, 0.5, 1.5, -1, ...Array(4).fill('From -1 to 1.5')]);
});

test('a number without limits is refused without telling of limits', async () => {
  ask({ ...NUMBER, low: -1e12, high: 1e12, whole: false });
  assert.deepEqual([await given('number', '12000,5'), await given('number', 'x')],
    [12000.5, 'A number']);
  ask({ ...NUMBER, low: -1e12, high: 1e12 });
  assert.equal(await given('number', '1.5'), 'A whole number');
});

test('a number with one limit is refused with that limit', async () => {
  ask({ ...NUMBER, low: 0, high: 1e9, whole: false });
  assert.deepEqual([await given('number', '1e6'), await given('number', '-0.5')],
    [1e6, 'At least 0']);
  ask({ ...NUMBER, low: -1e9, high: 10 });
  assert.equal(await given('number', '11'), 'Whole, at most 10');
});

test('a text is counted as the server does, and sent unchanged', async () => {
  ask(TEXT);
  assert.equal(await given('text', '😀'.repeat(10)), '😀'.repeat(10));
  assert.equal(await given('text', '😀'.repeat(11)), '10 at most; these are 11');
  assert.equal(await given('text', ''), 'Please answer');
  assert.equal(inputs('text')[0].tagName, 'INPUT');
  ask({ ...TEXT, longest: 10_000 });
  const long = `<b>"it's" & \\ {age}</b>\n\n  \u202esecond ${'ä😀'.repeat(4970)}`;
  assert.equal(inputs('text')[0].tagName, 'TEXTAREA');
  assert.equal(await given('text', long), long);
});

test('one of several choices, or several of them', async () => {
  ask(CHOICE);
  await click(inputs('choice')[0]);
  await click(inputs('choice')[1]);
  await goOn();
  assert.equal(told.pop().answers.choice, 'no');
  assert.ok(!question('choice').querySelector('b'));
  ask({ ...SEVERAL, name: 'several' });
  assert.match(textOf(root), /Several are possible Yes No, <b>/);
  await goOn();
  assert.equal(problem('several'), 'Please answer');
  await click(inputs('several')[1]);
  await click(inputs('several')[0]);
  await goOn();
  assert.deepEqual(told.pop().answers.several, ['yes', 'no']);
  await click(inputs('several')[0]);
  await goOn();
  assert.deepEqual(told.pop().answers.several, ['no']);
});

test('the places of a scale are numbered between its ends, or labelled', () => {
  ask(LIKERT);
  assert.equal(textOf(question('likert')), 'What of likert? 1 2 3 4 5 never always');
  ask({ ...LIKERT, left: '', right: '' });
  assert.equal(textOf(question('likert')), 'What of likert? 1 2 3 4 5');
  ask({ ...LIKERT, points: 3, labels: ['no', 'a bit', '<b>yes</b>'] });
  assert.equal(textOf(question('likert')), 'What of likert? no a bit <b>yes</b>');
  assert.ok(!question('likert').querySelector('b'));
});

test('a slider has no answer before a mark, which may be its middle', async () => {
  for (const [kind, more] of [['click'], ['pointerup'], ['keydown', { key: 'Enter' }],
    ['keydown', { key: ' ' }]]) {
    globalThis.sessionStorage.clear();
    ask({ ...SLIDER, low: 20, high: 80 });
    const [line] = inputs('slider');
    assert.ok(line.hasAttribute('data-unset'));
    assert.equal(line.value, '50');
    assert.equal(line.getAttribute('aria-valuetext'), 'not marked yet');
    send(line, 'keydown', { key: 'Tab' });
    await goOn();
    assert.deepEqual([told, problem('slider')], [[], 'Please answer']);
    send(line, kind, more);
    assert.ok(!line.hasAttribute('data-unset') && !line.hasAttribute('aria-valuetext'));
    await goOn();
    assert.equal(told.pop().answers.slider, 50, kind);
  }
  assert.match(textOf(question('slider')), /awake tired/);
});

test('a slider of few steps has a tick for each, one of many has none', () => {
  ask(SLIDER);
  assert.equal(question('slider').querySelectorAll('.ticks i').length, 21);
  ask({ ...SLIDER, step: 1 });
  assert.ok(!question('slider').querySelector('.ticks'));
});

test('after a reload all answers are there again, with the time at which they were given',
  async () => {
    ask(...ALL, { ...SEVERAL, name: 'several' });
    now_s = 1003;
    await click(inputs('likert')[1]);
    type('slider', '0');
    await click(inputs('choice')[0]);
    type('number', '42');
    type('text', '<b>');
    await click(inputs('several')[1]);
    now_s = 1100;
    ask(...ALL, { ...SEVERAL, name: 'several' });
    await goOn();
    assert.deepEqual(told[0].answers, { likert: 2, slider: 0, choice: 'yes', number: 42,
      text: '<b>', several: ['no'] });
    assert.deepEqual([told[0].shown_at, told[0].taken_s, told[0].after_s.slider], [1000, 100, 3]);
  });

test('a draft without a question, or of another kind, does no harm', async () => {
  globalThis.sessionStorage.setItem('crgame.draft.d', JSON.stringify({ shown_at: 990,
    answers: { gone: 1, text: 7, likert: 'x', slider: null }, after_s: {} }));
  ask(LIKERT, SLIDER, TEXT, { ...TEXT, name: 'constructor', required: false });
  await goOn();
  assert.deepEqual(['likert', 'slider', 'text'].map(problem), Array(3).fill('Please answer'));
  assert.equal(inputs('constructor')[0].value, '');
});

test('a question and its error are named for screen readers', () => {
  ask(TEXT, CHOICE, { ...NUMBER, required: false });
  const [field] = inputs('text');
  assert.equal(question('text').querySelector('label').getAttribute('for'), field.id);
  assert.equal(field.getAttribute('aria-describedby'),
    question('text').querySelector('.problem').id);
  assert.deepEqual([field.getAttribute('aria-required'),
    inputs('number')[0].getAttribute('aria-required')], ['true', null]);
  assert.equal(question('choice').tagName, 'FIELDSET');
  assert.equal(question('choice').getAttribute('aria-describedby'),
    question('choice').querySelector('.problem').id);
  const ids = [...root.querySelectorAll('[id]')].map(({ id }) => id);
  assert.equal(new Set(ids).size, ids.length);
});

test('successive questions on one scale are rows of a table, and answered as any other', () => {
  const row = (name, more = {}) => ({ ...LIKERT, name, ...more });
  const shown = { title: '', text: '', matrix: true, questions: [row('a'), row('b'), SLIDER,
    row('c'), row('d', { right: 'mostly' }), row('e', { right: 'mostly' })] };
  root.replaceChildren(questionForm(shown, words, new Draft('m', () => now_s),
    (answers) => told.push(answers)));
  const tables = [...root.querySelectorAll('.matrix')].map((node) =>
    [...node.querySelectorAll('.question')].map(({ dataset }) => dataset.name));
  assert.deepEqual(tables, [['a', 'b'], ['c'], ['d', 'e']]);
  assert.deepEqual([...root.querySelectorAll('.matrix-head')].map(textOf),
    ['never always', 'never always', 'never mostly']);
  for (const name of ['a', 'b', 'c', 'd', 'e']) {
    click(inputs(name)[2]);
  }
  type('slider', '30');
  goOn();
  assert.deepEqual(told[0].answers, { a: 3, b: 3, slider: 30, c: 3, d: 3, e: 3 });
});

const when = (name, tested = {}) => ({ question: name, one_of: [], at_least: null, below: null,
  ...tested });
const asks = (name) => !question(name).hidden;

test('a question is asked while its condition holds, and answered only then', async () => {
  ask(CHOICE, { ...NUMBER, when: when('choice', { one_of: ['yes'] }) },
    { ...TEXT, when: when('number', { at_least: 50 }) }, LIKERT);
  const asking = () => ['choice', 'number', 'text', 'likert'].filter(asks);
  assert.deepEqual(asking(), ['choice', 'likert']);
  await click(inputs('choice')[0]);
  assert.deepEqual(asking(), ['choice', 'number', 'likert']);
  type('number', '60');
  assert.deepEqual(asking(), ['choice', 'number', 'text', 'likert']);
  // What is asked has to be answered.
  await goOn();
  assert.deepEqual([problem('text'), summary(), told.length],
    ['Please answer', '2 are missing', 0]);
  type('text', 'word');
  // With its question, an answer goes, and so does what depends on it.
  await click(inputs('choice')[1]);
  assert.deepEqual(asking(), ['choice', 'likert']);
  await click(inputs('likert')[2]);
  await goOn();
  assert.deepEqual(told[0].answers, { choice: 'no', likert: 3 });
});

test('after a reload the questions are asked that were asked before', async () => {
  const shown = [CHOICE, { ...NUMBER, when: when('choice', { one_of: ['yes'] }) }];
  ask(...shown);
  await click(inputs('choice')[0]);
  ask(...shown);
  assert.equal(asks('number'), true);
});

test('a table whose rows are all left out shows no head', async () => {
  const row = (name) => ({ ...LIKERT, name, when: when('choice', { one_of: ['yes'] }) });
  const shown = { title: '', text: '', matrix: true, questions: [CHOICE, row('a'), row('b')] };
  root.replaceChildren(questionForm(shown, words, new Draft('m', () => now_s), () => {}));
  assert.equal(find('.matrix').hidden, true);
  await click(inputs('choice')[0]);
  assert.equal(find('.matrix').hidden, false);
});

test('conditions hold as the server says', () => {
  const cases = [[{ one_of: ['yes'] }, 'yes', true], [{ one_of: ['yes'] }, null, false],
    [{ one_of: ['a'] }, ['b', 'a'], true], [{ one_of: ['a'] }, [], false],
    [{ one_of: [3, 4] }, 4, true], [{ one_of: [3] }, 4, false], [{ one_of: ['3'] }, 3, false],
    [{ one_of: [3] }, '3', true], [{ at_least: 3 }, 3, true], [{ below: 3 }, 3, false],
    [{ at_least: 1, below: 3 }, 2, true], [{ at_least: 1 }, 'yes', false]];
  for (const [tested, answer, expected] of cases) {
    assert.equal(holds(when('q', tested), answer), expected, JSON.stringify([tested, answer]));
  }
});
