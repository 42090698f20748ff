// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Criticality of vehicles: as received, at a time, and at worst. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { CriticalityLog, isCritical, limitsOf } from
  '../../page/cockpit/js/criticality.js';
import { decodeFrame, KIND } from '../../page/cockpit/js/frames.js';
import { Store } from '../../page/cockpit/js/store.js';
import { close, frameOf } from './support.mjs';

const MEASURES = [
  ['gap', -1, 0], ['thw', -1, null], ['ttc', -1, 3], ['drac', 1, 3], ['pet', -1, 2],
].map(([name, worst, limit]) => ({ name, worst, limit, label: name, unit: '', definition: '' }));
const row = (index, values) => [index, ...MEASURES.flatMap(
  ({ name }) => (name in values ? [values[name], 2] : [NaN, -1]))];
const frame = (n, ...rows) => frameOf(KIND.CRITICALITY, 0, n, n / 10, n / 100, rows.length,
  ...rows.flat());
const logOf = (keeps_s, ...frames) => {
  const log = new CriticalityLog(() => MEASURES, keeps_s);
  frames.forEach((each) => log.add(decodeFrame(each)));
  return log;
};

test('a frame has a row per vehicle, with a value and another vehicle per measure', () => {
  const { kind, rows, width } = decodeFrame(
    frame(10, row(0, { ttc: 4 }), row(1, { drac: 2 })));
  assert.deepEqual([kind, width, rows.length], [KIND.CRITICALITY, 11, 22]);
  assert.equal(decodeFrame(frame(10)).rows.length, 0);
});

test('missing values over time are NaN', () => {
  const log = logOf(100, frame(10, row(0, { ttc: 4 })), frame(20, row(1, { ttc: 9 })),
    frame(30, row(0, { ttc: 3 })));
  const { t, values } = log.past(0, 'ttc');
  close(t, [0.1, 0.2, 0.3]);
  close(values, [4, NaN, 3]);
});

test('the values at a time are those of the step before it, unless it is too old', () => {
  const log = logOf(100, frame(10, row(0, { ttc: 4 })), frame(20, row(0, { ttc: 3 })));
  assert.deepEqual(log.at(0.19, 0, 'ttc'), { value: 4, of: 2 });
  assert.deepEqual(log.at(0.2, 0, 'ttc'), { value: 3, of: 2 });
  assert.equal(log.at(0.05, 0, 'ttc'), null);
  assert.equal(log.at(1.3, 0, 'ttc'), null);
  assert.equal(log.at(0.2, 0, 'gap'), null);
});

test('the worst past value is the smallest, for decelerations the greatest', () => {
  const log = logOf(100, frame(10, row(0, { ttc: 4, drac: 1 })),
    frame(20, row(0, { ttc: 2, drac: 3 })), frame(30, row(0, { ttc: 1, drac: 5 })));
  assert.deepEqual(log.worst(0.2, 0, 'ttc'), { value: 2, of: 2, t: 0.2 });
  assert.deepEqual(log.worst(0.2, 0, 'drac'), { value: 3, of: 2, t: 0.2 });
  assert.equal(log.worst(0.2, 1, 'ttc'), null);
});

test('the worst follows the time in both directions, and steps that are added or dropped', () => {
  const ttc = [5, 3, 4, 2, 6];
  const log = logOf(0.35, ...ttc.slice(0, 4).map((value, i) => frame(10 * i,
    row(0, { ttc: value }))));
  const worst = (t) => log.worst(t, 0, 'ttc')?.value;
  assert.deepEqual([0, 0.1, 0.2, 0.3, 0.2, 0, -1, 0.3].map(worst),
    [5, 3, 3, 2, 3, 5, undefined, 2]);
  // The first of four steps is dropped, then the worst of those left, then the last is repeated.
  log.add(decodeFrame(frame(40, row(0, { ttc: 6 }))));
  assert.deepEqual([worst(0.2), worst(0.4)], [3, 2]);
  log.add(decodeFrame(frame(50, row(0, { ttc: 7 }))));
  assert.deepEqual([worst(0.2), worst(0.5)], [4, 2]);
  log.add(decodeFrame(frame(50, row(0, { ttc: 1 }))));
  assert.equal(worst(0.5), 1);
});

test('a repeated step replaces all values from it on, and old values are dropped', () => {
  const log = logOf(0.15, ...[10, 20, 30, 20].map((n) => frame(n, row(0, { ttc: n }))));
  close(log.past(0, 'ttc').values, [20]);
  log.add(decodeFrame(frame(30, row(0, { ttc: 7 }))));
  close(log.past(0, 'ttc').values, [20, 7]);
});

test('a replay fetches it once, when the panel is opened', () => {
  let asked = 0;
  const log = new CriticalityLog(() => MEASURES, Infinity, () => { asked += 1; });
  log.want();
  log.want();
  assert.equal(asked, 1);
});

test('a reset clears it, a jump in a replay does not', () => {
  for (const [mode, left] of [['live', 0], ['replay', 1]]) {
    const store = new Store();
    store.receive({ type: 'hello', client: 'c', name: '', mode, version: '' });
    store.receiveFrame(frame(10, row(0, { ttc: 4 })), 0);
    store.restart(1);
    assert.equal(store.criticality.length, left, mode);
  }
});

test('limits come from the node, else the defaults hold', () => {
  assert.deepEqual(limitsOf(MEASURES, null), { gap: 0, ttc: 3, drac: 3, pet: 2 });
  const told = { criticality: { hv0: { thresholds: { ttc: 2.5, drac: null } } } };
  assert.deepEqual(limitsOf(MEASURES, told), { gap: 0, ttc: 2.5, drac: 3, pet: 2 });
});

test('values beyond their limit are critical, and contacts', () => {
  const limits = limitsOf(MEASURES, null);
  const critical = Object.fromEntries(MEASURES.map((measure) => [measure.name,
    [-1, 0, 1, 2.5, 4].filter((value) => isCritical(measure, limits, value))]));
  assert.deepEqual(critical, {
    gap: [-1, 0], thw: [], ttc: [-1, 0, 1, 2.5], drac: [4], pet: [-1, 0, 1],
  });
  assert.equal(isCritical(MEASURES[2], limits, undefined), false);
});
