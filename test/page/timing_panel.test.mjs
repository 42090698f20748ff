// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The figures of timekeeping: their texts and units, and what is marked as late. */

import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { createTiming, TABLE_I, valueOf, worstLateStep } from
  '../../page/cockpit/js/panels/timing.js';
import { liveStore, openPage, textOf } from './dom_support.mjs';

const GOOD = { final_error_ms: 0.5, mean_step_error_ms: 0.0123, max_cumulative_error_ms: 1.234,
  timeout_ratio: 0.001, real_time_ratio_final: 0.9996, real_time_ratio_mean: 1,
  real_time_ratio_min: 0.8, time_efficiency: 0.9999, precision_ratio: 2.5e-5, rate_hz: 100,
  worst_lag_ms: 3.14, late_steps: 12345, catch_up_steps: 0, step_error_p50_ms: 0.011,
  step_error_p99_ms: 0.2, busy_p50_ms: 2.5, busy_p99_ms: 6.75, resets: 0, dropped_ms: 0,
  frame_skip_orders: 2, cycles: 100000, duration_s: 1000.04, worst_late_step: '' };

let root, store;

beforeEach(() => {
  openPage('<section id="panel-timing"></section>');
  root = document.getElementById('panel-timing');
  store = liveStore([]);
  createTiming(root, store);
});

const show = (more) => store.receive({ type: 'status', run: 'running', n: 1, t: 0.1, epoch: 0,
  real_time_factor: 1, measured_factor: 1, frames_skipped: false, clients: 1, timing: GOOD,
  ...more });
const row = (key) => root.querySelector(`tr[data-key="${key}"]`);
const value = (key) => row(key).querySelector('td').textContent;
const late = () => [...root.querySelectorAll('[data-late]')].map(({ dataset }) => dataset.key);

test('each figure has its name, its unit and an explanation', () => {
  show();
  const texts = [...root.querySelectorAll('tr')].map((line) => textOf(line));
  assert.deepEqual(texts, ['Speed of time 1.00 × of 1.00 ×', 'Frames all shown',
    'Open pages 1 page', 'Answer time – ms', 'Lag now 0.50 ms', 'Mean step error 0.012 ms',
    'Largest lag 1.23 ms', 'Cycles over budget 0.10 %', 'Real-time ratio 1.000',
    'Real-time ratio, mean 1.000', 'Real-time ratio, slowest step 0.800',
    'Time efficiency 99.99 %', 'Precision ratio 2.5e−5', 'Rate 100.0 Hz', 'Worst lag 3.1 ms',
    'Late steps 12 345', 'Caught up 0', 'Step error, median 0.011 ms',
    'Step error, 99 % 0.200 ms', 'Computing, median 2.50 ms', 'Computing, 99 % 6.75 ms',
    'Drift resets 0', 'Time dropped 0.0 ms', 'Frame skips 2', 'Cycles 100 000',
    'Duration 1000.0 s']);
  assert.ok([...root.querySelectorAll('tr')].every(({ title }) => title !== ''));
  assert.equal(value('cycles'), '100\u202f000');
  assert.deepEqual(late(), []);
});

test('before the second step there are no figures, but the state of the run', () => {
  show({ timing: null });
  assert.doesNotMatch(textOf(root), /Lag now|Timekeeping/);
  assert.match(textOf(root), /Speed of time .* Measured from the second step on\.$/);
  show();
  assert.match(textOf(root), /Timekeeping Table I Lag now 0\.50 ms/);
  assert.doesNotMatch(textOf(root), /Measured from the second step on/);
});

// A step has 10 ms, and a run is late from 10 steps on; each pair is just good and just late.
for (const [key, good, bad] of [['final_error_ms', 100, 100.1], ['mean_step_error_ms', 10, 10.1],
  ['max_cumulative_error_ms', 100, 100.1], ['timeout_ratio', 0.01, 0.0101],
  ['real_time_ratio_final', 0.99, 0.989], ['time_efficiency', 0.99, 0.989],
  ['worst_lag_ms', 100, 100.1], ['busy_p50_ms', 10, 10.1], ['busy_p99_ms', 10, 10.1],
  ['resets', 0, 1], ['dropped_ms', 0, 0.1]]) {
  test(`${key} is late from ${bad} on, and no longer afterwards`, () => {
    show({ timing: { ...GOOD, [key]: good } });
    assert.deepEqual(late(), []);
    show({ timing: { ...GOOD, [key]: bad } });
    assert.deepEqual(late(), [key]);
    show();
    assert.deepEqual(late(), []);
  });
}

test('figures that only explain are never late', () => {
  show({ timing: { ...GOOD, real_time_ratio_min: 0.01, real_time_ratio_mean: 0.5,
    late_steps: 1e6, catch_up_steps: 1e6, frame_skip_orders: 1e6, precision_ratio: 0.5 } });
  assert.deepEqual(late(), []);
  assert.equal(value('precision_ratio'), '5.0e−1');
});

test('missing figures are dashes, and nothing of them is late', () => {
  show({ timing: { final_error_ms: null, resets: 'many' } });
  assert.deepEqual(['final_error_ms', 'timeout_ratio', 'precision_ratio', 'resets', 'cycles',
    'real_time_ratio_final'].map(value), ['– ms', '– %', '–', '–', '–', '–']);
  assert.deepEqual(late(), []);
});

test('a run that is slower than asked for is late, but not one that stands', () => {
  show({ real_time_factor: 0.5, measured_factor: 0.48 });
  assert.deepEqual([value('factor'), late()], ['0.48 × of 0.50 ×', []]);
  show({ real_time_factor: 0.5, measured_factor: 0.47 });
  assert.deepEqual(late(), ['factor']);
  show({ run: 'paused', real_time_factor: 0.5, measured_factor: 0 });
  assert.deepEqual([value('factor'), late()], ['0.00 × of 0.50 ×', []]);
  show({ real_time_factor: 2, measured_factor: null });
  assert.deepEqual([value('factor'), late()], ['2.00 ×', []]);
});

test('skipped frames, other pages and the answer time of the server are told', () => {
  store.round_trip_ms = 200;
  show({ frames_skipped: true, clients: 3 });
  assert.deepEqual(['skipping', 'clients', 'delay'].map(value),
    ['skipped to catch up', '3 pages', '200 ms']);
  assert.deepEqual(late(), ['skipping']);
  store.round_trip_ms = 201;
  show({ clients: undefined });
  assert.deepEqual([value('clients'), late()], ['0 pages', ['delay']]);
});

test('the worst late step is told with its causes, as text', () => {
  const worst = () => root.querySelector('[data-key=worst_late_step]').textContent;
  show();
  assert.equal(worst(), 'No step was late.');
  show({ timing: { ...GOOD, worst_late_step: 'step 7, 3 ms:\n<b>planner</b>' } });
  assert.equal(worst(), 'Worst late step: step 7, 3 ms: <b>planner</b>.');
  assert.equal(root.querySelector('b'), null);
  show({ timing: { ...GOOD, worst_late_step: undefined } });
  assert.match(worst(), /^This recording does not tell why steps were late/);
  assert.equal(worstLateStep({ worst_late_step: '' }), 'No step was late.');
});

test('figures of timing.json are found in their groups, live ones by their key', () => {
  const nested = { real_time_ratio: { final: 0.9, mean: 0.95, min: null }, resets: 2 };
  assert.equal(valueOf(nested, 'real_time_ratio_final'), 0.9);
  assert.ok(Number.isNaN(valueOf(nested, 'real_time_ratio_min')));
  assert.ok(Number.isNaN(valueOf(nested, 'real_time_ratio_other')));
  assert.equal(valueOf(nested, 'resets'), 2);
  assert.equal(valueOf({ ...nested, real_time_ratio_mean: 0.5 }, 'real_time_ratio_mean'), 0.5);
  assert.ok(Number.isNaN(valueOf({}, 'real_time_ratio_mean')));
  const flat = TABLE_I.map(([key]) => valueOf(GOOD, key));
  assert.ok(flat.every(Number.isFinite));
});

test('nothing is written while the panel is hidden, and all when it is shown', async () => {
  root.hidden = true;
  show({ clients: 5 });
  assert.equal(value('clients'), '');
  root.hidden = false;
  await globalThis.window.happyDOM.waitUntilComplete();
  assert.equal(value('clients'), '5 pages');
});
