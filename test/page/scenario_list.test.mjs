// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The scenarios to choose from, with their filter, and who drives in the chosen one. */

import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { ScenarioForm } from '../../page/cockpit/js/panels/scenario_form.js';
import { ScenarioList } from '../../page/cockpit/js/panels/scenario_list.js';
import { click, openPage, send, textOf } from './dom_support.mjs';

const IMAGE = '<img src=x onerror="window.ran = true">';
const LONG = 'ZAM_'.repeat(500);
const CUT_IN = { id: 'a', kind: 'scenario', name: 'ZAM_CutIn-1_1_T-1.xml', title: '' };
const GAME = { id: 'b', kind: 'game', name: 'cut_in.yaml', title: 'Cut in' };
const CRASH = { id: 'c', kind: 'game', name: 'crash.yaml', title: `A crash\n ${IMAGE} \u202e` };
const BROUGHT = { id: 'd', kind: 'upload', name: 'mine.xml', title: LONG };
const FOLDERS = [{ name: 'Shipped', entries: [CUT_IN, GAME] }, { name: 'Empty', entries: [] },
  { name: '<b>Own</b>', entries: [BROUGHT, CRASH] }];

let root, list, chosen, unwanted;

beforeEach(() => {
  root = openPage();
  [chosen, unwanted] = [[], []];
  list = new ScenarioList((entry) => chosen.push(entry), (entry) => unwanted.push(entry));
  root.append(list.root);
});

const items = () => [...root.querySelectorAll('button.scenario')];
const item = (id) => root.querySelector(`button.scenario[data-id="${id}"]`);
const marked = () => items().filter((button) => button.getAttribute('aria-checked') === 'true')
  .map(({ dataset }) => dataset.id);
const filter = (text) => {
  const input = root.querySelector('input[type=search]');
  input.value = text;
  send(input, 'input');
  return items().filter((node) => !node.closest('[hidden]')).map(({ dataset }) => dataset.id);
};
const folders = () => [...root.querySelectorAll('.scenario-folder')]
  .filter(({ hidden }) => !hidden).map((node) => node.querySelector('h3').textContent);
const hint = () => textOf(root.querySelector('.hint'));

test('the entries are in their folders, games first; empty folders are left out', () => {
  list.show(FOLDERS, '');
  assert.deepEqual(folders(), ['Shipped', '<b>Own</b>']);
  assert.deepEqual(items().map(({ dataset }) => dataset.id), ['b', 'a', 'c', 'd']);
  assert.deepEqual(list.games, [GAME, CRASH]);
});

test('an entry is called by its title, else by its name; all of it is text', () => {
  list.show(FOLDERS, '');
  assert.deepEqual(items().map(({ textContent }) => textContent),
    ['Cut in', 'ZAM_CutIn-1_1_T-1.xml', `\u2068A crash ${IMAGE} \u202e\u2069`, LONG]);
  assert.deepEqual([item('a').title, item('b').title], ['ZAM_CutIn-1_1_T-1.xml', 'cut_in.yaml']);
  assert.ok(!root.querySelector('img, b'));
});

test('a click chooses; the mark is set from outside', async () => {
  list.show(FOLDERS, 'b');
  assert.deepEqual(marked(), ['b']);
  await click(item('c'));
  assert.deepEqual([chosen, marked()], [[CRASH], ['b']]);
  list.mark('c');
  assert.deepEqual(marked(), ['c']);
  list.mark('');
  assert.deepEqual(marked(), []);
  assert.ok(items().every((button) => button.getAttribute('role') === 'radio'));
});

test('only an upload can be deleted, which does not choose it', async () => {
  list.show(FOLDERS, '');
  const bins = [...root.querySelectorAll('[data-action=delete]')];
  assert.deepEqual(bins.map(({ dataset }) => dataset.id), ['d']);
  assert.equal(bins[0].getAttribute('aria-label'), `Delete ${LONG}`);
  await click(bins[0]);
  assert.deepEqual([unwanted, chosen], [[BROUGHT], []]);
});

test('the filter takes all words, from title, name and kind, in any case', () => {
  list.show(FOLDERS, '');
  assert.deepEqual(filter('cut'), ['b', 'a']);
  assert.deepEqual(filter('  CUT   game '), ['b']);
  assert.deepEqual(filter('commonroad'), ['a']);
  assert.deepEqual(filter('uploaded'), ['d']);
  assert.deepEqual(filter('mine.xml'), ['d']);
  assert.deepEqual(folders(), ['<b>Own</b>'], 'a folder without a match is hidden');
  assert.deepEqual(filter(''), ['b', 'a', 'c', 'd']);
  assert.equal(hint(), '');
});

test('a filter without a match says so, and stays when the list comes anew', () => {
  list.show(FOLDERS, '');
  assert.deepEqual(filter('<i>x</i>'), []);
  assert.equal(hint(), 'Nothing is called "<i>x</i>".');
  filter('mine');
  list.show(FOLDERS, 'd');
  assert.deepEqual([items().filter((node) => !node.closest('[hidden]')).length, marked(), hint()],
    [1, ['d'], '']);
});

test('nothing is left of an upload that the filter leaves out', () => {
  list.show(FOLDERS, '');
  filter('cut');
  assert.deepEqual(folders(), ['Shipped']);
});

test('an empty list says so', () => {
  list.show([], '');
  assert.equal(hint(), 'No scenario in the configured folders.');
  list.show([{ name: 'Empty', entries: [] }], '');
  assert.deepEqual([folders(), hint()], [[], 'No scenario in the configured folders.']);
  list.show(FOLDERS, '');
  assert.equal(hint(), '');
});

const PREVIEW = { humans: [{ id: 'hv0', driver: 'cockpit' }, { id: 'hv1', driver: 'joy:1' }],
  avs: [{ id: 'av0', planner: '/home/me/own.py:Planner', planning_problem: 100 },
    { id: 'av1', planner: 'idm', planning_problem: null }] };
const DRIVERS = ['auto', 'idle', 'cockpit', 'evdev', 'joy'];
const PLANNERS = ['idm', 'lattice'];

/** Show the form of a preview. */
function formOf(preview = PREVIEW) {
  const form = new ScenarioForm();
  root.append(form.root);
  form.show(preview, DRIVERS, PLANNERS);
  return form;
}

const select = (id) => root.querySelector(`select[aria-label^="${id} "]`);
const texts = (id) => [...select(id).options].map(({ text }) => text);

test('each vehicle has its own choice, in which the present one is chosen', () => {
  const form = formOf();
  assert.deepEqual([...root.querySelectorAll('.who-row')].map(
    (row) => ['strong', '.dim'].map((name) => textOf(row.querySelector(name))).join(' ')),
  ['hv0 driven by', 'hv1 driven by', 'av0 planned by', 'av1 planned by']);
  assert.deepEqual(texts('hv0'), ['cockpit – a cockpit page',
    "auto – this machine's wheel, gamepad or keyboard", 'idle – no driver',
    'evdev – a wheel or gamepad at this machine', 'joy – messages on the joy topic']);
  assert.equal(texts('hv1')[0], 'joy:1');
  assert.deepEqual(texts('av0'), ['own.py:Planner', 'idm', 'lattice']);
  assert.deepEqual(texts('av1'), ['idm', 'lattice']);
  assert.deepEqual([...root.querySelectorAll('.who-row')].map(({ title }) => title),
    ['', '', 'planning problem 100', '']);
  assert.deepEqual(form.choices, { humans: [...PREVIEW.humans], avs: [
    { id: 'av0', planner: '/home/me/own.py:Planner' }, { id: 'av1', planner: 'idm' }] });
});

test('the choices are what the person has chosen, until another scenario is shown', () => {
  const form = formOf();
  select('hv0').value = 'idle';
  select('av1').value = 'lattice';
  assert.deepEqual([form.choices.humans[0], form.choices.avs[1]],
    [{ id: 'hv0', driver: 'idle' }, { id: 'av1', planner: 'lattice' }]);
  form.show({ humans: [{ id: 'hv0', driver: 'auto' }], avs: [] }, DRIVERS, PLANNERS);
  assert.deepEqual(form.choices, { humans: [{ id: 'hv0', driver: 'auto' }], avs: [] });
  assert.equal(form.blame('hv1: no joy'), false, 'it is not in this one');
  form.show({ humans: [], avs: [] }, DRIVERS, PLANNERS);
  assert.equal(textOf(form.root), '');
});

test('an error is shown beside the vehicle that it names, else refused', () => {
  const form = formOf();
  const errors = () => [...root.querySelectorAll('.field-error')].map(
    ({ textContent }) => textContent);
  const invalid = () => ['hv0', 'hv1', 'av0', 'av1'].filter(
    (id) => select(id).getAttribute('aria-invalid') === 'true');
  assert.equal(form.blame('hv1: no joy <b>here</b>'), true);
  assert.deepEqual([errors(), invalid()], [['', 'hv1: no joy <b>here</b>', '', ''], ['hv1']]);
  assert.equal(form.blame('there is no planner "idm"'), true);
  assert.deepEqual(invalid(), ['av1']);
  assert.equal(form.blame('hv10 is not in the scenario'), false);
  assert.deepEqual([errors(), invalid()], [['', '', '', ''], []]);
  form.blame('hv0 and av0 stand in the same place');
  assert.deepEqual(invalid(), ['hv0'], 'told once');
  assert.equal(form.blame(''), false);
  assert.deepEqual([errors(), invalid()], [['', '', '', ''], []]);
});

test('hostile names of vehicles and planners are text', () => {
  const form = formOf({ humans: [{ id: IMAGE, driver: IMAGE }], avs: [] });
  assert.ok(!root.querySelector('img'));
  assert.equal(root.querySelector('strong').textContent, IMAGE);
  assert.deepEqual(form.choices.humans, [{ id: IMAGE, driver: IMAGE }]);
});

/** Let the planner `idm` tell its options, and count how often it is asked. */
function answering(options) {
  const asked = [];
  globalThis.fetch = async (path) => {
    asked.push(path);
    const content = path.endsWith('=idm') ? { options } : { error: 'lattice: is not installed' };
    return new Response(JSON.stringify(content), { status: content.error ? 400 : 200 });
  };
  return asked;
}

const GAP = { name: 'time_gap', wanted: 'a number', default: '1.5', meaning: 'to the leader [s]' };
const MODE = { name: 'mode', wanted: 'text', default: '', meaning: IMAGE };

async function opened(id) {
  const details = select(id).closest('.who-row').querySelector('details');
  details.open = true;
  send(details, 'toggle');
  while (textOf(details).includes('Asking')) {
    await new Promise((done) => { setTimeout(done, 0); });
  }
  return details;
}

test("a planner's options are asked for when they are opened, and sent when typed", async () => {
  const asked = answering([GAP, MODE]);
  const form = formOf({ humans: [], avs: [
    { id: 'av0', planner: 'idm', planning_problem: null, options: { time_gap: '2' } }] });
  assert.deepEqual([asked, form.choices.avs], [[], [{ id: 'av0', planner: 'idm' }]]);
  const details = await opened('av0');
  assert.deepEqual(asked, ['/api/planner?name=idm']);
  const [gap, mode] = details.querySelectorAll('input');
  assert.deepEqual([gap.value, gap.placeholder, mode.value, mode.placeholder],
    ['2', '1.5', '', 'required']);
  assert.ok(textOf(details).includes('to the leader [s]; a number') && !root.querySelector('img'));
  mode.value = ' fast ';
  assert.deepEqual(form.choices.avs[0].options, { time_gap: '2', mode: 'fast' });
  gap.value = '';
  assert.deepEqual(form.choices.avs[0].options, { mode: 'fast' });
  await opened('av0');
  assert.equal(asked.length, 1, 'they are known');
});

test('another planner has other options; why it tells none is said', async () => {
  answering([GAP]);
  const form = formOf({ humans: [], avs: [
    { id: 'av0', planner: 'idm', planning_problem: null, options: { time_gap: '2' } }] });
  await opened('av0');
  select('av0').value = 'lattice';
  send(select('av0'), 'change');
  assert.deepEqual(form.choices.avs, [{ id: 'av0', planner: 'lattice' }]);
  const details = await opened('av0');
  assert.ok(textOf(details).includes('lattice: is not installed'));
  assert.deepEqual(form.choices.avs, [{ id: 'av0', planner: 'lattice' }]);
  select('av0').value = 'idm';
  send(select('av0'), 'change');
  await opened('av0');
  assert.deepEqual(form.choices.avs[0].options, { time_gap: '2' });
});
