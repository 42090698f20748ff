// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Numbers, times, seats, events and marks in words, as a reader would write them. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { shortName } from '../../page/cockpit/js/driving/device_panel.js';
import { describeSeat } from '../../page/cockpit/js/driving/seat_text.js';
import { clockTime, count, errorText, fixed, NONE, oneLine, plural } from
  '../../page/cockpit/js/panels/format.js';
import {
  TABLE_I, valueOf, worstLateStep,
} from '../../page/cockpit/js/panels/timing.js';
import { countText } from '../../page/cockpit/js/perception/unseen.js';
import { eventText } from '../../page/cockpit/js/replay/marks.js';

test('fixed: a true minus, none before zero, a dash for other values', () => {
  assert.equal(fixed(3.14159, 2), '3.14');
  assert.equal(fixed(-3.14159, 1), '\u22123.1');
  assert.equal(fixed(-0.004, 2), '0.00');
  assert.equal(fixed(0, 0), '0');
  for (const nothing of [null, undefined, NaN, Infinity]) {
    assert.equal(fixed(nothing, 1), NONE);
  }
});

test('the clock shows seconds with one digit', () => {
  assert.deepEqual([65.24, 0, -0.5, null, NaN].map(clockTime),
    ['65.2 s', '0.0 s', '\u22120.5 s', NONE, NONE]);
});

test('a thin space separates thousands', () => {
  assert.deepEqual([0, 999, 1000, 1234567, -12345].map(count),
    ['0', '999', '1\u202f000', '1\u202f234\u202f567', '\u221212\u202f345']);
});

test('one is singular, all other numbers are plural', () => {
  assert.deepEqual([0, 1, 2].map((number) => plural(number, 'plan')),
    ['0 plans', '1 plan', '2 plans']);
  assert.equal(plural(3, 'entry', 'entries'), '3 entries');
});

test('any thrown value becomes one line', () => {
  assert.equal(oneLine(' two\n\t lines '), 'two lines');
  assert.equal(oneLine(null), '');
  assert.equal(errorText(new TypeError('no such thing')), 'no such thing');
  assert.equal(errorText('thrown as text'), 'thrown as text');
});

test('figures are found live and nested as in timing.json', () => {
  assert.equal(valueOf({ real_time_ratio_min: 0.5 }, 'real_time_ratio_min'), 0.5);
  assert.equal(valueOf({ real_time_ratio: { min: 0.25 } }, 'real_time_ratio_min'), 0.25);
  assert.ok(Number.isNaN(valueOf({}, 'real_time_ratio_min')));
  assert.ok(Number.isNaN(valueOf({ final_error_ms: null }, 'final_error_ms')));
});

test('the worst late step is described in words, also if it is unknown', () => {
  assert.equal(worstLateStep({ worst_late_step: '7.0 ms late: 7.0 ms\n own work' }),
    'Worst late step: 7.0 ms late: 7.0 ms own work.');
  assert.equal(worstLateStep({ worst_late_step: '' }), 'No step was late.');
  assert.match(worstLateStep({ final_error_ms: 1 }), /does not tell/);
});

test('table I: the text of each figure, and the value from which it is late', () => {
  const figures = new Map(TABLE_I.map(([key, , , format, isLate]) => [key, { format, isLate }]));
  assert.equal(figures.get('final_error_ms').format(12.345), '12.35 ms');
  assert.equal(figures.get('timeout_ratio').format(0.0123), '1.23 %');
  assert.equal(figures.get('precision_ratio').format(0.00012), '1.2e\u22124');
  // A lag of ten steps of 10 ms is late, as timesync_node has it; a step error of one step.
  const late = (key, value) => figures.get(key).isLate(value, 10);
  assert.deepEqual([late('final_error_ms', 100), late('final_error_ms', 101)], [false, true]);
  assert.deepEqual([late('mean_step_error_ms', 10), late('mean_step_error_ms', 11)],
    [false, true]);
  assert.deepEqual([late('real_time_ratio_final', 0.99), late('real_time_ratio_final', 0.98)],
    [false, true]);
});

test('a browser\'s id of a gamepad becomes its name', () => {
  assert.equal(shortName('G29 Driving Wheel (Vendor: 046d Product: c24f)'), 'G29 Driving Wheel');
  assert.equal(shortName('046d-c24f-Logitech G29'), 'Logitech G29');
  assert.equal(shortName('(STANDARD GAMEPAD Vendor: 045e Product: 028e)'), 'Gamepad');
});

test('the driver of a seat', () => {
  const seat = { source: 'game', driver: 'joy:lap.joy.yaml', holder: null, holder_name: null };
  const say = (more, role = 'human', planner = undefined) =>
    describeSeat({ ...seat, ...more }, role, planner, 'c1');
  assert.equal(say({}), 'Driven by the script lap.joy.yaml');
  assert.equal(say({ driver: 'evdev:G29: wheel' }), 'Driven by the device G29: wheel');
  assert.equal(say({ driver: 'whatever:x' }), 'Driven as the game says');
  assert.equal(say({ holder: 'c1', holder_name: 'Ada' }), 'You drive');
  assert.equal(say({ holder: 'c2', holder_name: 'Ada' }), 'Driven by Ada in a cockpit');
  assert.equal(say({ holder: 'c2', holder_name: '' }), 'Driven by c2 in a cockpit');
  assert.equal(say({ source: 'cockpit', driver: 'cockpit' }), 'Waits for a driver in a cockpit');
  assert.equal(say({ source: 'cockpit' }), 'Left by its driver in a cockpit');
  assert.equal(say({ source: 'replay' }), 'Driven as in the recording');
  assert.equal(say({ source: 'autopilot' }), 'Driven by the source autopilot');
  assert.equal(say({ source: 'planner' }, 'autonomous', 'idm'), 'Driven by the planner idm');
  assert.equal(say({ source: 'planner' }, 'autonomous'), 'Driven by its planner');
});

test('this page is not the holder before the server has named it', () => {
  const seat = { source: 'game', driver: 'idle', holder: '', holder_name: 'X' };
  assert.equal(describeSeat(seat, 'human', undefined, ''), 'Driven by X in a cockpit');
});

test('a count of perception names its range only if there is one', () => {
  assert.equal(countText({ seen: 3, near: 4, range: 79.6 }), 'sees 3 of 4 within 80 m');
  assert.equal(countText({ seen: 3, near: 4, range: null }), 'sees 3 of 4');
});

test('a mark on the time line', () => {
  const mark = { t: 12.345, kind: 'collision', subject: 'hv0', text: 'with car 3', count: 1 };
  assert.equal(eventText(mark), '12.35 s  Collision (hv0): with car 3');
  assert.equal(eventText({ ...mark, kind: 'some_thing', subject: '', text: '', count: 4 }),
    '12.35 s  some thing, 4 times');
});
