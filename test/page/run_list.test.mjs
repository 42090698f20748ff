// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The panel of past runs: their cards, comparison, scores, files and deletion. */

import assert from 'node:assert/strict';
import { setImmediate as soon } from 'node:timers/promises';
import { afterEach, before, beforeEach, test } from 'node:test';

import { RunList } from '../../page/cockpit/js/after/run_list.js';
import { click, liveStore, openPage, send, textOf } from './dom_support.mjs';

const run = (id, more = {}) => ({ id, name: `run/${id}`, title: `Title of ${id}`, scenario: 'ZAM',
  began_ms: 1e12, duration_s: 12.34, contacts: 0, closed: true, finished: true,
  bytes: 1.26e6, files: [{ name: 'game.yaml', bytes: 20_000 }], ...more });
const REPORT = { name: 'report.html', bytes: 5e6 };

let body, root, store, asked, answers, opened;

// The question before deleting is one dialog for the whole page.
before(() => {
  body = openPage();
});

beforeEach(() => {
  [asked, opened] = [[], []];
  answers = { runs: () => Response.json({ runs: [run('r2'), run('r1')] }) };
  globalThis.fetch = async (address, { method = 'GET', body: content, headers } = {}) => {
    asked.push([method, address, content, headers?.['X-Crgame']].filter(Boolean).join(' '));
    return answers[address.split('?')[0].split('/').at(-1)]();
  };
  globalThis.window.open = (...values) => opened.push(values);
  root = document.createElement('section');
  body.append(root);
  store = liveStore([]);
});

afterEach(() => root.remove());

/** Let answers and observers come. */
async function settled() {
  for (let i = 0; i < 6; i += 1) {
    await soon();
  }
}

async function begin(...runs) {
  if (runs.length > 0) {
    answers.runs = () => Response.json({ runs });
  }
  new RunList(root, store);
  await settled();
}

const changed = async (...runs) => {
  answers.runs = () => Response.json({ runs });
  store.receive({ type: 'files', epoch: 0, run: 'r1', folder: '', names: [] });
  await settled();
};
const cards = () => [...root.querySelectorAll('.run')];
const card = (id) => cards().find(({ dataset }) => dataset.run === id);
const action = (id, name) => card(id).querySelector(`[data-action=${name}]`);
const compare = () => root.querySelector('button.wide');
const alert = () => root.querySelector('[role=alert]').textContent;
const hint = () => root.querySelector('[role=status]').textContent;
const choose = (id, on = true) => {
  const box = card(id).querySelector('input[type=checkbox]');
  box.checked = on;
  send(box, 'change');
};
const dialog = () => document.querySelector('dialog.confirm');
const answer = async (text) => {
  await click([...dialog().querySelectorAll('button')].find((node) => node.textContent === text));
  await settled();
};

test('the runs are listed as the server orders them, with what is known of each', async () => {
  await begin(run('r2', { contacts: 2 }), run('r1', { title: '', began_ms: null,
    duration_s: null, contacts: null, bytes: 0 }), run('r0', { title: '', scenario: '' }));
  assert.deepEqual(cards().map(({ dataset }) => dataset.name), ['run/r2', 'run/r1', 'run/r0']);
  assert.deepEqual(cards().map((node) => node.querySelector('h3').textContent),
    ['Title of r2', 'ZAM', 'run/r0']);
  assert.deepEqual(cards().slice(0, 2).map((node) => node.querySelector('.dim').textContent),
    [`${new Date(1e12).toLocaleString()} · 12.3 s · 2 contacts · 1.3 MB · run/r2`,
      '0.0 MB · run/r1']);
  assert.deepEqual(asked, ['GET /api/runs']);
});

test('an empty list says so', async () => {
  answers.runs = () => Response.json({ runs: [] });
  await begin();
  assert.equal(hint(), 'Nothing has been recorded yet.');
  await changed(run('r1'));
  assert.equal(hint(), '');
});

test('a run that is being recorded can neither be read nor deleted', async () => {
  await begin(run('r1', { closed: false, finished: false }));
  assert.match(textOf(card('r1')), /being recorded/);
  assert.ok(!card('r1').querySelector('input, img, details, [data-action=replay]'));
  assert.equal(action('r1', 'delete').disabled, true);
  assert.match(action('r1', 'delete').title, /being recorded/);
  await changed(run('r1', { finished: false }));
  assert.ok(action('r1', 'replay') && action('r1', 'delete').disabled);
  await changed(run('r1'));
  assert.equal(action('r1', 'delete').disabled, false);
});

test('replay, report and files open at their addresses', async () => {
  const id = 'a b/ü&c';
  await begin(run(id, { files: [REPORT, { name: 'x&y.mcap', bytes: 2e6 }] }));
  await click(action(id, 'replay'));
  await click(action(id, 'report'));
  const coded = encodeURIComponent(id);
  assert.deepEqual(opened, [[`/replay/${coded}/`, '_blank', 'noopener'],
    [`/api/runs/file?id=${coded}&file=report.html`, '_blank', 'noopener']]);
  const links = [...card(id).querySelectorAll('a[download]')];
  assert.deepEqual(links.map((link) => [link.textContent, link.getAttribute('href')]), [
    ['Everything as ZIP', `/api/runs/zip?id=${coded}`],
    ['report.html', `/api/runs/file?id=${coded}&file=report.html`],
    ['x&y.mcap', `/api/runs/file?id=${coded}&file=x%26y.mcap`]]);
  assert.match(textOf(links[1].parentNode), /5\.00 MB/);
  assert.equal(card(id).querySelector('img').getAttribute('src'),
    `/api/runs/picture?id=${coded}`);
  await changed(run('r1'));
  assert.ok(!action('r1', 'report'), 'without a report');
});

test('two to six runs are compared', async () => {
  const ids = ['a', 'b', 'c', 'd', 'e', 'f', 'g,h'];
  await begin(...ids.map((id) => run(id)));
  const state = () => [compare().textContent, compare().disabled];
  assert.deepEqual(state(), ['Choose runs to compare them', true]);
  choose('a');
  assert.deepEqual(state(), ['Choose runs to compare them', true]);
  choose('g,h');
  assert.deepEqual(state(), ['Compare 2 runs', false]);
  await click(compare());
  assert.deepEqual(opened, [['/api/runs/comparison?ids=a,g%2Ch', '_blank', 'noopener']]);
  ids.slice(1, 5).forEach((id) => choose(id));
  assert.deepEqual(state(), ['Compare 6 runs', false]);
  choose('f');
  assert.deepEqual(state(), ['At most 6 can be compared', true]);
  choose('f', false);
  assert.deepEqual(state(), ['Compare 6 runs', false]);
});

test('a chosen run that is gone is chosen no more; unchanged runs keep their cards', async () => {
  await begin(run('r2'), run('r1'), run('r0'));
  const kept = card('r1');
  ['r2', 'r1', 'r0'].forEach((id) => choose(id));
  await changed(run('r3'), run('r1'), run('r0', { contacts: 1 }));
  assert.deepEqual([cards().length, compare().textContent], [3, 'Compare 2 runs']);
  assert.ok(card('r1') === kept, 'its picture is not asked for again');
  assert.ok(card('r0').querySelector('input').checked);
  assert.match(textOf(card('r0')), /1 contact /);
});

test('a score is shown, hidden again, and its refusal is told', async () => {
  await begin(run('r 1'));
  const score = { refusal: '', vehicles: [{ vehicle: 'av0', role: 'autonomous', score: null,
    parts: [], distance: 10, fastest: 5, remarks: ['no <i>goal</i>'] }, { vehicle: 'hv0',
    role: 'human', score: 0.876, distance: 1234.4, fastest: 10, remarks: [], parts: [
      { name: 'Comfort', value: 0.5, weight: 2, definition: 'soft' }] }] };
  answers.score = () => Response.json(score);
  await click(action('r 1', 'score'));
  await settled();
  assert.equal(asked.at(-1), 'GET /api/runs/score?id=r%201');
  const shown = [...card('r 1').querySelectorAll('.score-vehicle')];
  assert.deepEqual(shown.map((node) => textOf(node.querySelector('summary'))), [
    'hv0 88 of 100 1234 m, up to 36 km/h', 'av0 – no <i>goal</i> 10 m, up to 18 km/h']);
  assert.match(textOf(shown[0]), /Comfort 50 %/);
  await click(action('r 1', 'score'));
  assert.ok(!card('r 1').querySelector('.score'));
  let told;
  answers.score = () => new Promise((resolve) => { told = resolve; });
  await click(action('r 1', 'score'));
  assert.match(textOf(card('r 1')), /Scoring the run/);
  told(Response.json({ vehicles: [], refusal: '' }));
  await settled();
  assert.match(textOf(card('r 1')), /No score: no vehicle was driven/);
  await click(action('r 1', 'score'));
  answers.score = () => Response.json({ error: 'it is broken' }, { status: 400 });
  await click(action('r 1', 'score'));
  await settled();
  assert.match(textOf(card('r 1')), /No score: it is broken/);
});

test('a run is deleted after a question, and a refusal is shown', async () => {
  await begin(run('r2', { files: [REPORT, REPORT] }), run('r1'));
  answers.delete = () => Response.json({ text: 'deleted' });
  await click(action('r2', 'delete'));
  assert.match(textOf(dialog()), /^Delete run\/r2\? 2 files, 1\.3 MB: .*cannot be brought/);
  await answer('Cancel');
  assert.equal(asked.length, 1);
  await click(action('r2', 'delete'));
  answers.runs = () => Response.json({ runs: [run('r1')] });
  await answer('Delete');
  assert.deepEqual(asked.slice(1), ['POST /api/runs/delete {"id":"r2"} 1', 'GET /api/runs']);
  assert.ok(!card('r2'));
});

test('a refused deletion is told', async () => {
  await begin(run('r1'));
  answers.delete = () => Response.json({ error: 'it is <b>being read</b>' }, { status: 400 });
  answers.runs = () => new Promise(() => {});
  await click(action('r1', 'delete'));
  await answer('Delete');
  assert.equal(alert(), 'it is <b>being read</b>');
  assert.ok(card('r1'));
});

test('a refused deletion is still told after the list has come',
  async () => {
    await begin(run('r1'));
    answers.delete = () => Response.json({ error: 'it is being read' }, { status: 400 });
    await click(action('r1', 'delete'));
    await answer('Delete');
    assert.equal(alert(), 'it is being read');
  });

test('a list that cannot be fetched keeps the former one; the error ends with the next',
  async () => {
    await begin(run('r1'));
    answers.runs = () => Response.json({ error: 'the disk is full' }, { status: 500 });
    store.receive({ type: 'hello', client: 'c1', name: 'Ada', mode: 'live', version: '1' });
    await settled();
    assert.deepEqual([alert(), cards().length], ['the disk is full', 1]);
    await changed(run('r1'));
    assert.equal(alert(), '');
  });

test('the list is fetched while its panel is shown, not before', async () => {
  root.hidden = true;
  await begin(run('r1'));
  assert.deepEqual(asked, []);
  root.hidden = false;
  await settled();
  assert.deepEqual([asked.length, cards().length], [1, 1]);
});

test('a recording has no list of runs', async () => {
  store.receive({ type: 'hello', client: 'c1', name: 'Ada', mode: 'replay', version: '1' });
  await begin(run('r1'));
  assert.deepEqual([asked, cards().length], [[], 0]);
  assert.match(textOf(root), /^A recording is being shown: its cockpit has the list of runs\.$/);
});

test('hostile titles and names are text', async () => {
  const text = '<b>x</b>\u202e'.repeat(100);
  await begin(run('r1', { title: text, name: text, files: [{ name: text, bytes: 0 }] }));
  assert.ok(!root.querySelector('b'));
  assert.equal(card('r1').querySelector('h3 bdi').textContent, text);
});
