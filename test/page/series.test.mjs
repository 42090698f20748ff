// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Series for plots: their thinning, and the values of their lines. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { emptyHistory } from '../../page/cockpit/js/history.js';
import { QUANTITIES, traces } from '../../page/cockpit/js/panels/quantities.js';
import { HealthLog, MOST_POINTS, thin, unwrap } from
  '../../page/cockpit/js/panels/series.js';
import { close } from './support.mjs';

const times = (count, spacing_s) => Array.from({ length: count }, (_, i) => i * spacing_s);

test('a short series stays unchanged within its window', () => {
  const { x, y } = thin([0, 1, 2, 3, 4], [5, 6, NaN, 8, 9], 1, 3);
  assert.deepEqual([x, y], [[1, 2, 3], [6, null, 8]]);
});

test('an empty series stays empty', () => {
  assert.deepEqual(thin([], [], 0, 10), { x: [], y: [] });
  assert.deepEqual(thin([1, 2], [1, 2], 5, 10), { x: [], y: [] });
});

test('a long series keeps few points, among them every peak', () => {
  const t = times(12_000, 0.01);
  const values = t.map((time) => Math.sin(time));
  values[4321] = 50;
  values[8765] = -50;
  const { x, y } = thin(t, values, 0, 120);
  assert.ok(x.length <= MOST_POINTS && x.length > MOST_POINTS / 2, `${x.length} points`);
  assert.equal(y[x.indexOf(t[4321])], 50);
  assert.equal(y[x.indexOf(t[8765])], -50);
  assert.ok(x.every((time, i) => i === 0 || time > x[i - 1]), 'in their order');
  // Each of them is a point of the series, none an average.
  assert.ok(x.every((time, i) => values[Math.round(time / 0.01)] === y[i]));
});

test('the drawn line does not tremble while the window moves on', () => {
  const t = times(12_000, 0.01);
  const values = t.map((time) => Math.sin(37 * time));
  const inner = (from, to) => thin(t, values, from, to).x.filter((time) => time > 5 && time < 60);
  assert.deepEqual(inner(0, 100), inner(0.37, 100.37));
});

test('a gap stays a gap in thinned-out stretches', () => {
  const t = times(10_000, 0.01);
  const values = t.map((time) => (time >= 40 && time < 60 ? NaN : 1));
  const { x, y } = thin(t, values, 0, 100);
  assert.ok(y.some((value) => value === null));
  assert.ok(x.every((time, i) => y[i] !== null || (time >= 39 && time < 61)));
});

test('unwrapping the heading of a circling car gives a line', () => {
  const straight = times(100, 0.4);
  const wrapped = straight.map((angle) => Math.atan2(Math.sin(angle), Math.cos(angle)));
  close(unwrap(wrapped), straight, 1e-9);
  close(unwrap(wrapped.map((angle) => -angle)), straight.map((angle) => -angle), 1e-9);
});

test('a missing angle does not affect the others', () => {
  close(unwrap([0, NaN, 0.1]), [0, NaN, 0.1]);
});

const status = (t, latency_ms, lag) => ({
  t, planners: { av0: { latency_ms } }, timing: { final_error_ms: lag, mean_step_error_ms: 0.1 },
});

test('figures are kept for a limited time, and replaced if a replay goes back', () => {
  const log = new HealthLog(10);
  for (const t of [0, 1, 2, 11, 12]) {
    log.add(status(t, 10 * t, t));
  }
  assert.deepEqual(log.t, [2, 11, 12]);
  log.add(status(11, 5, 6));
  assert.deepEqual([log.t, log.column('lag'), log.latency('av0')], [[2, 11], [2, 6], [20, 5]]);
  assert.ok(log.latency('av9').every(Number.isNaN));
  log.clear();
  assert.deepEqual(log.t, []);
});

test('a status without time, timing or planners gives no figures', () => {
  const log = new HealthLog(10);
  log.add({ t: null });
  assert.deepEqual(log.t, []);
  log.add({ t: 1, timing: null });
  assert.ok(Number.isNaN(log.column('step_error')[0]));
});

const quantity = (key) => QUANTITIES.find((item) => item.key === key);
const vehicle = (id, role, columns) => (
  { id, role, color: `color of ${id}`, past: { ...emptyHistory(), ...columns } });
const VIEW = { from: 0, to: 10, shown: 2 };

test('headings are plotted in degrees, without their jumps', () => {
  const past = { t: [0, 1, 2], yaw: [3.0, -3.2 + 0.2, 3.1] };
  const [trace] = traces(quantity('heading'), {
    vehicles: [vehicle('hv0', 'human', past)], health: new HealthLog(1), runColor: '' }, VIEW);
  close(trace.y, [3, 2 * Math.PI - 3, 3.1].map((angle) => angle * 180 / Math.PI), 1e-9);
});

test('a jump in speed is not unwrapped as an angle', () => {
  const past = { t: [0, 1, 2], speed: [0, 20, 0] };
  const [trace] = traces(quantity('speed'), {
    vehicles: [vehicle('hv0', 'human', past)], health: new HealthLog(1), runColor: '' }, VIEW);
  assert.deepEqual([trace.name, trace.y], ['hv0', [0, 20, 0]]);
});

test('pedals are two lines a vehicle, in per cent; the value is that of the shown time', () => {
  const past = { t: [0, 1, 2, 3], throttle: [0, 0.5, 0.25, 1], brake: [1, 0, 0, 0] };
  const lines = traces(quantity('pedals'), {
    vehicles: [vehicle('hv0', 'human', past)], health: new HealthLog(1), runColor: '' }, VIEW);
  assert.deepEqual(lines.map(({ name, dash, now }) => [name, dash, now]),
    [['hv0 throttle', 'solid', 25], ['hv0 brake', 'dot', 0]]);
  assert.deepEqual(lines[0].y, [0, 50, 25, 100]);
});

test('latency has lines of AVs only, drift those of the run', () => {
  const health = new HealthLog(100);
  health.add(status(1, 42, 7));
  const data = { vehicles: [vehicle('hv0', 'human', {}), vehicle('av0', 'autonomous', {})],
    health, runColor: 'grey' };
  const latency = traces(quantity('latency'), data, VIEW);
  assert.deepEqual(latency.map(({ name, y, color }) => [name, y, color]),
    [['av0', [42], 'color of av0']]);
  assert.deepEqual(traces(quantity('drift'), data, VIEW).map(({ name, now, color }) =>
    [name, now, color]), [['lag', 7, 'grey'], ['mean step error', 0.1, 'grey']]);
});
