// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Gamepads, wheels and keys: the meaning of their raw values, and its calibration. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { CalibrationRun } from '../../page/cockpit/js/driving/calibration_run.js';
import { PutBackNotice } from '../../page/cockpit/js/driving/put_back_notice.js';
import {
  defaultProfile, gearAfter, keepProfiles, loadProfile, pedalValue, rawValue, saveProfile,
  steeringValue,
} from '../../page/cockpit/js/driving/gamepad_profile.js';
import { close, keepStorage } from './support.mjs';

const axis = (index, more) => (
  { kind: 'axis', index, min: -1, max: 1, invert: false, deadzone: 0, ...more });
const axes = (...values) => ({ axes: values, buttons: [] });

test('a pedal over its range, normal and inverted', () => {
  const pedal = (value, more) => pedalValue(axes(value), axis(0, more));
  close([-1, -0.5, 0, 1, 2, -2].map((value) => pedal(value)), [0, 0.25, 0.5, 1, 1, 0]);
  // A Logitech pedal rests at +1.
  close([1, 0.5, -1].map((value) => pedal(value, { invert: true })), [0, 0.25, 1]);
});

test('a dead zone is cut off, and the rest is stretched to the full range', () => {
  const control = { kind: 'button', index: 0, min: 0, max: 1, invert: false, deadzone: 0.2 };
  const pedal = (value) => pedalValue({ axes: [], buttons: [value] }, control);
  close([0.1, 0.2, 0.6, 1].map(pedal), [0, 0, 0.5, 1]);
});

test('steering is positive to the left, each side by its own travel', () => {
  const control = axis(0, { centre: 0.2 });
  const steer = (value, more) => steeringValue(axes(value), { ...control, ...more });
  close([-1, -0.4, 0.2, 0.6, 1].map((value) => steer(value)), [1, 0.5, 0, -0.5, -1]);
  close([-1, 1].map((value) => steer(value, { invert: true })), [-1, 1]);
  assert.ok(Object.is(steer(0.2), 0), 'no negative zero');
});

test('a device that lacks an axis steers and brakes nothing', () => {
  assert.ok(Number.isNaN(rawValue(axes(), axis(3))));
  assert.equal(pedalValue(axes(), axis(3)), 0);
  assert.equal(steeringValue(axes(), axis(3, { centre: 0 })), 0);
});

test('gears: paddles, a button that changes, and a lever that is held', () => {
  const buttons = { on: [4], off: [5], toggle: [6], held: [18] };
  const after = (reverse, index, pressed = true) => gearAfter(buttons, reverse, index, pressed);
  assert.deepEqual([after(false, 4), after(true, 4), after(true, 5), after(false, 5)],
    [true, true, false, false]);
  assert.deepEqual([after(false, 6), after(true, 6)], [true, false]);
  // A release changes only the lever; other buttons change nothing.
  assert.deepEqual([after(true, 6, false), after(true, 9), after(false, 9)], [true, true, false]);
  assert.deepEqual([after(false, 18), after(true, 18, false)], [true, false]);
});

const pad = (id, resting, more) => ({ id, mapping: '', axes: resting, buttons: [], ...more });

test('pedals of an uncalibrated wheel', () => {
  const pedals = (...given) => {
    const { throttle, brake } = defaultProfile(pad(...given));
    return [throttle.index, brake.index];
  };
  assert.deepEqual(pedals('G29 (Vendor: 046d Product: c24f)', [0, 0, 1, 1]), [2, 3]);
  assert.deepEqual(pedals('G920 (Vendor: 046d Product: c262)', [0, 1, 1, 0]), [1, 2]);
  // Axes of unknown wheels that rest at +1 are pedals; the first of three is a clutch.
  assert.deepEqual(pedals('X', [0, 0, 0, 1, 1]), [3, 4]);
  assert.deepEqual(pedals('X', [0, 1, 1, 1]), [2, 3]);
  assert.deepEqual(pedals('X', [0, 0, 0]), [1, 2]);
});

test('a standard gamepad: its stick and triggers', () => {
  const profile = defaultProfile(pad('X', [0, 0], { mapping: 'standard' }));
  assert.deepEqual([profile.throttle.kind, profile.throttle.index, profile.brake.index],
    ['button', 7, 6]);
  assert.equal(profile.steering.index, 0);
});

test('a calibration is kept for its device, and a broken one is ignored', (t) => {
  const kept = keepStorage();
  const wheel = pad('X', [0, 1, 1]);
  const own = defaultProfile(wheel);
  own.steering.deadzone = 0.25;
  saveProfile('X', own);
  assert.deepEqual(loadProfile(wheel), { profile: own, calibrated: true });
  assert.equal(loadProfile(pad('Y', [0, 1, 1])).calibrated, false);
  t.mock.method(console, 'warn', () => {});
  for (const broken of ['{', 'null', '{"steering": 1}', JSON.stringify({ ...own, reverse: {} }),
    JSON.stringify({ ...own, brake: { ...own.brake, max: null } }),
    JSON.stringify({ ...own, steering: { ...own.steering, centre: undefined } })]) {
    kept.set('crgame.gamepad.X', broken);
    assert.deepEqual(loadProfile(wheel), { profile: defaultProfile(wheel), calibrated: false });
  }
  saveProfile('X', null);
  assert.equal(kept.size, 0);
});

test('valid calibrations of another page are kept', (t) => {
  const kept = keepStorage();
  t.mock.method(console, 'warn', () => {});
  const own = defaultProfile(pad('X', [0, 1, 1]));
  keepProfiles({ X: JSON.stringify(own), Y: '{', Z: '{"steering": 1}', W: 5 });
  assert.deepEqual([...kept.keys()], ['crgame.gamepad.X']);
  assert.deepEqual(loadProfile(pad('X', [0, 1, 1])).profile, own);
});

/** Move a control there and back, slowly enough for each step to end by itself. */
class Hands {
  now_ms = 0;

  constructor(run, rest) {
    this.run = run;
    this.sample = rest;
  }

  hold(part, index, value, for_ms = 100) {
    const values = [...this.sample[part]];
    values[index] = value;
    this.sample = { ...this.sample, [part]: values };
    for (const end_ms = this.now_ms + for_ms; this.now_ms < end_ms; this.now_ms += 20) {
      this.run.feed(this.sample, this.now_ms);
    }
  }

  move(part, index, to) {
    const from = this.sample[part][index];
    // A pedal does not jump: a first value far from 0 had not been reported before.
    this.hold(part, index, from + 0.4 * (to - from));
    this.hold(part, index, to);
    this.hold(part, index, from, 700);
  }
}

function calibrated(rest, moves) {
  const run = new CalibrationRun(defaultProfile(pad('X', [0, 0, 0])));
  const hands = new Hands(run, rest);
  run.feed(rest, 0);
  assert.ok(run.next());
  for (const [step, part, index, to] of moves) {
    assert.equal(run.step, step);
    hands.move(part, index, to);
  }
  return run;
}

test('calibrating a wheel: each step ends by itself with the moved control', () => {
  const run = calibrated({ axes: [0.02, 0, 1, 1], buttons: [0, 0, 0, 0, 0, 0] }, [
    ['left', 'axes', 0, -0.9], ['right', 'axes', 0, 0.95], ['throttle', 'axes', 2, -1],
    ['brake', 'axes', 3, -0.8], ['reverse', 'buttons', 1, 1], ['left_indicator', 'buttons', 2, 1],
    ['right_indicator', 'buttons', 3, 1], ['hazard', 'buttons', 4, 1], ['horn', 'buttons', 0, 1],
    ['put_back', 'buttons', 5, 1]]);
  assert.equal(run.step, 'test');
  assert.deepEqual(run.profile.put_back, [5]);
  // Button 3 was the default for hazard lights, and now has one function only.
  assert.deepEqual(run.profile.lights,
    { left_indicator: [2], right_indicator: [3], hazard: [4], horn: [0] });
  const { steering, throttle, brake, reverse } = run.profile;
  assert.deepEqual([steering.index, steering.min, steering.centre, steering.max, steering.invert],
    [0, -0.9, 0.02, 0.95, false]);
  assert.deepEqual([throttle.index, throttle.min, throttle.max, throttle.invert],
    [2, -1, 1, true]);
  assert.deepEqual([brake.index, brake.min, brake.max, brake.invert], [3, -0.8, 1, true]);
  assert.deepEqual(reverse.toggle, [1]);
  // The result gives the intended commands.
  close(steeringValue({ axes: [-0.9], buttons: [] }, steering), 1);
  close(pedalValue({ axes: [0, 0, -1], buttons: [] }, throttle), 1);
  close(pedalValue({ axes: [0, 0, 1], buttons: [] }, throttle), 0);
});

test('a pedal that reads 0 until it is touched rests at its first value', () => {
  const run = new CalibrationRun(defaultProfile(pad('X', [0, 0, 0])));
  const hands = new Hands(run, { axes: [0, 0, 0], buttons: [] });
  run.feed(hands.sample, 0);
  run.next();
  run.skip();
  assert.equal(run.step, 'throttle', 'left and right are one measurement');
  hands.hold('axes', 2, 0.9);
  hands.hold('axes', 2, -1);
  hands.hold('axes', 2, 1, 700);
  assert.equal(run.step, 'brake');
  assert.deepEqual([run.profile.throttle.min, run.profile.throttle.max,
    run.profile.throttle.invert], [-1, 1, true]);
});

test('both pedals on one axis: the brake is its other direction', () => {
  const run = calibrated({ axes: [0, 0], buttons: [0] }, [
    ['left', 'axes', 0, -1], ['right', 'axes', 0, 1], ['throttle', 'axes', 1, 1],
    ['brake', 'axes', 1, -1]]);
  assert.equal(run.step, 'reverse');
  const { throttle, brake } = run.profile;
  assert.deepEqual([throttle.min, throttle.max, throttle.invert], [0, 1, false]);
  assert.deepEqual([brake.min, brake.max, brake.invert], [-1, 0, true]);
});

test('axes that tremble or belong to another control are not chosen', () => {
  const run = new CalibrationRun(defaultProfile(pad('X', [0, 0, 0])));
  const hands = new Hands(run, { axes: [0, 0, 1], buttons: [0] });
  run.feed(hands.sample, 0);
  run.next();
  hands.hold('axes', 1, 0.25);
  assert.equal(run.found, null);
  assert.ok(!run.next(), 'nothing has been moved');
  hands.hold('buttons', 0, 1);
  assert.equal(run.found, null, 'no button steers');
  hands.hold('axes', 0, -0.5);
  assert.deepEqual([run.found.kind, run.found.index], ['axis', 0]);
  hands.hold('axes', 0, 0, 700);
  assert.equal(run.step, 'right');
  // Right is on the axis of left, even if another axis moves more.
  hands.hold('axes', 2, -1);
  assert.equal(run.found, null);
});

test('skipping a step keeps the previous binding', () => {
  const before = defaultProfile(pad('X', [0, 1, 1]));
  const run = new CalibrationRun(before);
  run.feed({ axes: [0, 1, 1], buttons: [] }, 0);
  run.next();
  for (let i = 0; i < 9; i += 1) {
    run.skip();
  }
  assert.equal(run.step, 'test');
  assert.deepEqual(run.profile, before);
});

test('a refused request to be put back is reported once', (t) => {
  t.mock.timers.enable({ apis: ['setTimeout'] });
  /** @type {string[]} */
  const told = [];
  const stop = { name: 'contact of hv0 with o1', n: 5, k: 1, by: 'contact' };
  const back = { name: 'put back hv0', n: 9, k: 1, by: 'driver' };
  const store = /** @type {any} */ ({ fired: [], status: { run: 'running' },
    receive: (/** @type {{text: string}} */ message) => told.push(message.text) });
  const notice = new PutBackNotice(store);
  /** @param {object[]} before @param {object[]} after events at the request, and later */
  const ask = (before, after) => {
    store.fired = before;
    notice.update('hv0', true);
    notice.update('hv0', true);
    store.fired = after;
    t.mock.timers.tick(2000);
    notice.update('hv0', false);
    return told.splice(0).length;
  };
  assert.equal(ask([], []), 0);
  assert.equal(ask([stop], [stop]), 1);
  assert.equal(ask([stop], [stop, back]), 0);
  assert.equal(ask([stop, back], [stop, back]), 0);
  assert.equal(ask([{ ...stop, name: 'contact of hv1 with hv0' }], []), 0);
});
