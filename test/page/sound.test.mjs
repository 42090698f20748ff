// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Numbers of sound and rumble: engine speeds, levels, directions, kerbs and motors. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import {
  CAR, ELECTRIC, engineSpeed_rpm, gearAfter, HEAVY, lockedSpeed_rpm, REVERSE, tone_Hz,
} from '../../page/cockpit/js/sound/drive_train.js';
import {
  arrival, attenuation, dopplerFactor, RANGE_M,
} from '../../page/cockpit/js/sound/hearing.js';
import {
  cornering, engineLevel, hardBraking, tyreLevel, volumeGain, windLevel,
} from '../../page/cockpit/js/sound/levels.js';
import { Kerbs } from '../../page/cockpit/js/sound/kerbs.js';
import {
  Listener, MOST_OTHERS,
} from '../../page/cockpit/js/sound/listener.js';
import { Feeling, Rumble } from '../../page/cockpit/js/sound/rumble.js';
import { close, laneletOf } from './support.mjs';

const QUIET = { collision: false, offRoad: false, kerb: 0 };

test('the engine speed follows from wheels and gears', () => {
  // 30 m/s: 96.77 rad/s at wheels of 0.31 m, in the sixth gear 0.691 * 3.46 times as fast.
  close(lockedSpeed_rpm(CAR, 5, 30), 2209.5, 0.5);
  close(engineSpeed_rpm(CAR, 5, 30, 0.4), 2209.5, 0.5);
  close(tone_Hz(CAR, 3000), 100);
  // Four pole pairs: eight pulses a turn. 20 m/s is 64.5 rad/s, 9 times as fast at the motor.
  close(tone_Hz(ELECTRIC, engineSpeed_rpm(ELECTRIC, 0, 20, 1)), 8 * 9 * 20 / 0.31 / (2 * Math.PI));
  close(engineSpeed_rpm(ELECTRIC, 0, 0, 1), 0);
  close(engineSpeed_rpm(CAR, 0, 0, 0), 800);
  assert.ok(engineSpeed_rpm(CAR, 0, 0, 1) > 1500, 'the clutch slips');
  close(engineSpeed_rpm(CAR, REVERSE, 3, 0), lockedSpeed_rpm(CAR, REVERSE, 3));
});

test('gears change in order, later with more throttle, and without hunting', () => {
  for (const train of [CAR, HEAVY, ELECTRIC]) {
    for (const throttle of [0, 0.3, 0.7, 1]) {
      let gear = 0;
      for (let speed = 0; speed < 50; speed += 0.05) {
        const next = gearAfter(train, gear, speed, throttle);
        assert.ok(next >= gear, `${train.name} changes down at ${speed} m/s while it gains speed`);
        assert.equal(gearAfter(train, next, speed, throttle), next, 'it stays in the new gear');
        assert.ok(gear === next || lockedSpeed_rpm(train, next, speed) >= train.idle_rpm);
        gear = next;
      }
      assert.equal(gear, throttle === 1 && train === CAR ? 4 : train.ratios.length - 1);
      assert.equal(gearAfter(train, gear, 0, throttle), 0);
    }
  }
  const speedOfSecond = (throttle) => {
    let speed = 0;
    while (gearAfter(CAR, 0, speed, throttle) === 0) {
      speed += 0.01;
    }
    return speed;
  };
  assert.ok(speedOfSecond(1) > 2 * speedOfSecond(0));
});

test('Doppler, distance and direction', () => {
  close(dopplerFactor(0, 0), 1);
  close(dopplerFactor(34.3, 0), 1 / 0.9);
  close(dopplerFactor(-34.3, 0), 1 / 1.1);
  close(dopplerFactor(0, 34.3), 1.1);
  assert.ok(Number.isFinite(dopplerFactor(1e9, -1e9)));
  close(attenuation(1), attenuation(2), 1e-3);
  close(attenuation(20) / attenuation(10), 0.5 * (1 - 0.04) / (1 - 0.01));
  assert.equal(attenuation(RANGE_M), 0);
  assert.equal(attenuation(1e9), 0);

  // Heading north with a vehicle on each side: west is left.
  const north = { x: 0, y: 0, yaw: Math.PI / 2, vx: 0, vy: 0 };
  const at = (x, y, vx = 0, vy = 0) => arrival(north, { x, y, yaw: 0, vx, vy });
  close(at(-10, 0).pan, -1);
  close(at(10, 0).pan, 1);
  close(at(0, 10).pan, 0);
  close(at(0, -10).pan, 0);
  close(at(10, 10).pan, Math.SQRT1_2);
  close(at(10, 0, -20).doppler, 343 / (343 - 20));
  close(at(10, 0, 20).doppler, 343 / (343 + 20));
  // A vehicle that drives alongside is heard without a Doppler shift.
  close(arrival({ ...north, vy: 30 }, { x: 3, y: 0, yaw: 0, vx: 0, vy: 30 }).doppler, 1);
  close(at(0, 0).doppler, 1);
});

test('levels grow with speed as in vehicle acoustics', () => {
  const decibel = (ratio) => 20 * Math.log10(ratio);
  close(decibel(tyreLevel(30) / tyreLevel(3)), 35);
  close(decibel(windLevel(30) / windLevel(3)), 60);
  assert.equal(tyreLevel(0), 0);
  assert.equal(windLevel(0), 0);
  assert.ok(windLevel(200) <= 0.2);
  assert.equal(engineLevel(ELECTRIC, 0, 1), 0);
  for (const train of [CAR, HEAVY, ELECTRIC]) {
    const { idle_rpm: idle, limit_rpm: limit } = train;
    assert.ok(engineLevel(train, limit, 0.5) > engineLevel(train, idle + 500, 0.5));
    assert.ok(engineLevel(train, limit, 1) > engineLevel(train, limit, 0));
    assert.ok(engineLevel(train, limit, 1) <= 0.36);
  }
  assert.equal(hardBraking(4, 20), 0);
  assert.equal(hardBraking(9, 20), 1);
  assert.equal(hardBraking(9, 0), 0);
  assert.equal(cornering(-9.5, 20), 1);
  assert.equal(cornering(3, 20), 0);
  close(volumeGain(0.5), 0.25);
});

const shape = { kind: 'rectangle', length: 4.5, width: 1.8, vertices: [] };
const vehicle = (id, more = {}) => ({
  id, role: 'human', shape, rear_to_center: 1.3, wheelbase: 2.6, max_steering_angle: 0.9,
  powertrain: 'combustion', perception: null, driver_place: { eye: [1.2, 0.36, 1.2] },
  ...more,
});
const row = (x, y, yaw, speed, more = {}) => [
  x, y, yaw, speed, 0, more.acceleration ?? 0, more.yaw_rate ?? 0, 0, more.throttle ?? NaN,
  more.brake ?? NaN, NaN, more.reverse ?? NaN, more.lights ?? NaN,
];
const sceneOf = (vehicles, objects = []) => ({ vehicles, objects });
const shownOf = (vehicles, objects = [], t = 0) => ({
  t, vehicles: new Float64Array(vehicles.flat()), objects: new Float64Array(objects.flat()),
});

test('a driver hears the own vehicle and vehicles nearby', () => {
  const listener = new Listener();
  const objects = [
    { id: '1', type: 'truck', role: 'recorded', shape: { ...shape, length: 12 } },
    { id: '2', type: 'pedestrian', role: 'recorded', shape },
    { id: '3', type: 'car', role: 'static', shape },
    { id: '4', type: 'car', role: 'recorded', shape },
  ];
  const scene = sceneOf([vehicle('hv0'), vehicle('av0', { powertrain: 'electric' })], objects);
  const shown = shownOf(
    [row(0, 0, 0, 20, { throttle: 0.5, acceleration: 1, yaw_rate: 0.1, lights: 1 }),
      row(10, -4, 0, 25, { lights: 4 })],
    [[-20, 4, 0, 18, 0, 0], [5, 5, 0, 1, 0, 0], [5, -5, 0, 0, 0, 0], Array(6).fill(NaN)]);
  const { own, others } = listener.hear(scene, shown, 'hv0');
  assert.equal(own.train, CAR);
  assert.equal(own.load, 0.5);
  assert.deepEqual([own, ...others].map(({ lights }) => lights), [1, 4, 0]);
  close(own.deceleration, -1);
  close(own.lateral, 2);
  assert.deepEqual(others.map(({ id, train }) => [id, train]), [['av0', ELECTRIC], ['1', HEAVY]]);
  assert.ok(others[0].pan > 0 && others[1].pan < 0);
  // From the driver's head, 1.2 m ahead of the rear axle and 0.36 m to the left, to the middle.
  close(others[0].distance, Math.hypot(10 + 1.3 - 1.2, -4 - 0.36));
  assert.equal(listener.hear(scene, shown, 'nobody'), null);
  assert.equal(listener.hear(scene, shown, '2'), null, 'on foot nobody has an engine');
  assert.equal(listener.hear(scene, shown, '1').own.train, HEAVY);
  assert.equal(listener.hear(scene, shown, 'av0').own.train, ELECTRIC);
});

test('driving backwards uses the reverse gear, and deceleration there is braking', () => {
  const scene = sceneOf([vehicle('hv0')]);
  const { own } = new Listener().hear(
    scene, shownOf([row(0, 0, 0, -4, { acceleration: 6, throttle: 0, reverse: 1 })]), 'hv0');
  assert.equal(own.gear, REVERSE);
  close(own.speed, 4);
  close(own.deceleration, 6);
});

test('only the nearest of many vehicles are heard', () => {
  const count = 30;
  const scene = sceneOf(Array.from({ length: count }, (_, i) => vehicle(`av${i}`)));
  const rows = Array.from({ length: count }, (_, i) => row(3 * i, 0, 0, 10));
  const { others } = new Listener().hear(scene, shownOf(rows), 'av0');
  assert.deepEqual(others.map(({ id }) => id),
    Array.from({ length: MOST_OTHERS }, (_, i) => `av${i + 1}`));
});

// Drive a car along x from one y to another, sampled every 30 ms; return the y of each kerb.
const feltAcross = (lanelets, from, to, { speed = 10, dy = 0.05 } = {}) => {
  const kerbs = new Kerbs({ lanelets });
  const felt = [];
  const count = Math.round(Math.abs(to - from) / dy);
  for (let i = 0; i <= count; i += 1) {
    const y = from + i * dy * Math.sign(to - from);
    const shown = shownOf([row(20 + 0.03 * speed * i, y, 0, speed)], [], 0.03 * i);
    const strength = kerbs.over(vehicle('hv0'), shown, 0);
    if (strength > 0) {
      felt.push([Number(y.toFixed(2)), strength]);
    }
  }
  return felt;
};

test('kerbs are felt exactly where wheels cross them', () => {
  const kerb = laneletOf({ left_line: 'curb', right_line: 'lowered_curb' });
  // The kerbs lie at y = 2 and -2, the wheels 0.8 m from the middle: left ones, then right ones.
  assert.deepEqual(feltAcross([kerb], 0, 4), [[1.25, 1], [2.85, 1]]);
  assert.deepEqual(feltAcross([kerb], 4, 0), [[2.8, 1], [1.2, 1]]);
  assert.deepEqual(feltAcross([kerb], 0, -1.5), [[-1.2, 0.35]]);
  assert.deepEqual(feltAcross([kerb], 0, 1), [], 'along it');
  assert.deepEqual(feltAcross([laneletOf()], 0, 4), [], 'paint is flat');
  // A vehicle that was moved has not crossed the kerb; one on a late page has.
  assert.deepEqual(feltAcross([kerb], 0, 4, { speed: 0.1, dy: 4 }), []);
  assert.deepEqual(feltAcross([kerb], 0, 1.5, { speed: 40, dy: 1.5 }), [[1.5, 1]]);
  // Where another lane crosses, as in junctions, the kerb does not exist.
  const across = laneletOf({ id: 2, y: 2, width: 3 });
  assert.deepEqual(feltAcross([kerb, across], 0, 3), []);
  assert.deepEqual(feltAcross([{ ...kerb, adj_left: 2 }, across], 0, 2), [[1.25, 1]]);
});

test('positions before a reset cross no kerb', () => {
  const kerbs = new Kerbs({ lanelets: [laneletOf({ left_line: 'curb' })] });
  const at = (y, t) => kerbs.over(vehicle('hv0'), shownOf([row(20, y, 0, 10)], [], t), 0);
  assert.equal(at(1.1, 0), 0);
  kerbs.reset();
  assert.equal(at(1.3, 0.03), 0);
  assert.equal(at(1.1, 0.06), 1);
});

test('a gamepad feels ground, kerbs, collisions and hard braking, and nothing else', () => {
  const feeling = new Feeling();
  const calm = { speed: 20, deceleration: 0 };
  const still = { strong: 0, weak: 0 };
  assert.deepEqual(feeling.of(calm, QUIET, 0), still);
  const kerb = feeling.of(calm, { ...QUIET, offRoad: true }, 100);
  assert.ok(kerb.strong > 0.5);
  const rough = feeling.of(calm, { ...QUIET, offRoad: true }, 600);
  assert.ok(rough.weak > 0 && rough.strong < kerb.strong);
  feeling.of(calm, QUIET, 700);
  assert.deepEqual(feeling.of(calm, QUIET, 1200), still);
  assert.equal(feeling.of(calm, { ...QUIET, collision: true }, 1300).strong, 1);
  assert.deepEqual(feeling.of(calm, { ...QUIET, collision: true }, 2000), still, 'once');
  const hard = { speed: 20, deceleration: 9 };
  const beats = [2100, 2200].map((now) => feeling.of(hard, QUIET, now).weak);
  assert.ok(Math.min(...beats) > 0 && Math.max(...beats) > 2 * Math.min(...beats), 'it beats');
  const over = (share, now) => feeling.of(calm, { ...QUIET, kerb: share }, now).strong;
  close(over(1, 2210), kerb.strong);
  assert.ok(over(0, 2300) > 0 && over(0, 2400) === 0);
  assert.ok(over(0.35, 2500) < 0.5 * kerb.strong);
  feeling.of(calm, QUIET, 2800);
  // An event before a pause is not felt after it.
  feeling.reset();
  assert.deepEqual(feeling.of(calm, { ...QUIET, collision: true }, 2300), still);
});

test('motors get the chosen strength and stop when they must', () => {
  const calls = [];
  const actuator = {
    playEffect: (type, effect) => {
      calls.push([type, effect.strongMagnitude, effect.weakMagnitude]);
      return Promise.resolve('complete');
    },
    reset: () => {
      calls.push(['reset']);
      return Promise.resolve('complete');
    },
  };
  const rumble = new Rumble();
  const own = { speed: 20, deceleration: 0 };
  rumble.feel(actuator, own, { ...QUIET, offRoad: true }, 0.5, 0);
  close(calls[0].slice(1), [0.5 * 0.4, 0.5 * 0.6]);
  rumble.feel(actuator, own, { ...QUIET, offRoad: true }, 0.5, 10);
  assert.equal(calls.length, 1, 'not in every frame');
  rumble.feel(actuator, own, { ...QUIET, offRoad: true }, 0, 100);
  assert.deepEqual(calls.at(-1), ['reset']);
  rumble.feel(actuator, own, { ...QUIET, offRoad: true, kerb: 1 }, 1, 110);
  rumble.feel(actuator, own, { ...QUIET, offRoad: true }, 1, 180);
  close(calls.at(-1).slice(1), [0.7, 0.7]);
  rumble.feel(actuator, own, QUIET, 1, 200);
  rumble.stop();
  assert.equal(calls.at(-1)[0], 'reset');
  rumble.stop();
  assert.equal(calls.filter(([name]) => name === 'reset').length, 2, 'only what turns is stopped');
});
