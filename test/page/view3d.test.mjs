// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The 3D view's geometry, choices and bodies, without three.js and without a browser. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

const VIEW = '../../page/cockpit/js/view3d';
const { above, chasing, mountedAt } = await import(`${VIEW}/cameras.js`);
const { acrossAngle, heightAngle, readSeat, trueAngle } = await import(
  `${VIEW}/field_of_view.js`);
const { wantsHeadlights } = await import(`${VIEW}/headlights.js`);
const { KeyAnswer } = await import(`${VIEW}/key_answer.js`);
const { localOrigin } = await import(`${VIEW}/local_origin.js`);
const { mirrorCamera, MIRRORS } = await import(`${VIEW}/mirrors.js`);
const { DETAILS, isSoftware, Quality } = await import(`${VIEW}/quality.js`);
const { steeringOf } = await import(`${VIEW}/traffic.js`);
const { isWithin } = await import(`${VIEW}/seen_instances.js`);
const { readViewWindow } = await import(`${VIEW}/view_window.js`);
const { MeshBuilder } = await import(`${VIEW}/bodies/mesh_builder.js`);
const { plainBody } = await import(`${VIEW}/bodies/plain_bodies.js`);
const { ofObject, ofVehicle } = await import(`${VIEW}/bodies/appearance.js`);

const DEGREE = Math.PI / 180;
const near = (actual, expected, within, what) => assert.ok(
  Math.abs(actual - expected) <= within, `${what ?? ''} ${actual} is not ${expected}`);
const PLACE = { height: 1.42, bonnet_height: 0.95, eye: [1.25, 0.36, 1.17],
  left_mirror: [1.78, 0.92, 0.98], right_mirror: [1.78, -0.92, 0.98],
  inner_mirror: [1.75, 0, 1.26] };

test('a picture true to scale subtends the same angles as reality', () => {
  // A screen of 0.6 m, seen from 0.7 m: half of it from the middle is atan(0.3 / 0.7).
  near(trueAngle({ screen_width_m: 0.6, eye_distance_m: 0.7 }, 1), 2 * 23.1986 * DEGREE, 1e-5);
  // A window of half the width does not have half the angle.
  near(trueAngle({ screen_width_m: 0.6, eye_distance_m: 0.7 }, 0.5), 2 * 12.0948 * DEGREE, 1e-5);
  // 1.8 m at 20 m are 5.15 degrees, also on the screen.
  const across = acrossAngle({ screen_width_m: 0.6, eye_distance_m: 0.7 }, 75, 960, 1920);
  const share = (0.9 / 20) / Math.tan(across / 2);
  const onGlass_m = 0.6 * 0.5 * share;
  near(2 * Math.atan(onGlass_m / 2 / 0.7) / DEGREE, 5.15, 0.01);
});

test('a chosen field of view is horizontal and within limits', () => {
  near(acrossAngle(null, 90, 800, 1920), 90 * DEGREE, 1e-9);
  near(acrossAngle(null, 500, 800, 1920), 140 * DEGREE, 1e-9);
  near(heightAngle(90 * DEGREE, 2), 2 * Math.atan(0.5), 1e-9);
  assert.ok(heightAngle(140 * DEGREE, 0.5) <= 110 * DEGREE);
});

test('extra pictures are drawn only when a vehicle may react to a key', () => {
  const answer = new KeyAnswer();
  assert.ok(!answer.isDue(3));
  answer.pressed(3, 1);
  // The shown state was simulated before the newest one and is no reaction yet.
  const due = [2.98, 3, 3.005, 3.02, 3.03, 3.045, 3.06, 9].filter((t) => answer.isDue(t));
  assert.deepEqual(due, [3.02, 3.03, 3.045]);
  answer.pressed(8.99, 1);
  assert.ok(!answer.isDue(3.02) && answer.isDue(9.01));
});

test('a key causes at most three extra pictures, at slow and fast pace', () => {
  for (const rate of [0.1, 1, 5]) {
    const answer = new KeyAnswer();
    answer.pressed(3, rate);
    // Frames of a screen of 144 Hz, all extra ones, for as long as a key takes at least.
    const drawn = [];
    for (let wall_s = 0; wall_s < 2; wall_s += 1 / 144) {
      if (answer.isDue(3 + rate * wall_s)) {
        answer.drawn();
        drawn.push(wall_s);
      }
    }
    assert.equal(drawn.length, 3, `rate ${rate}`);
    // The next cycle obeys the key at any pace; then follows the transmission back.
    near(drawn[0], 0.008 / rate, 1 / 144);
    answer.pressed(20, rate);
    assert.ok(answer.isDue(20.009) && !answer.isDue(20.0081 + 0.042 * rate));
  }
});

test('wheels are turned as those of a single-track model that moves so', () => {
  const [wheelbase, angle] = [2.7, 0.21];
  for (const speed of [1, 5, -3, 30]) {
    near(steeringOf(wheelbase, speed, speed * Math.tan(angle) / wheelbase), angle, 1e-12);
    near(steeringOf(wheelbase, speed, -speed * Math.tan(angle) / wheelbase), -angle, 1e-12);
  }
  near(steeringOf(2.7, 10, 0), 0, 0);
  // A recorded car may turn on the spot, which wheels cannot do.
  near(steeringOf(2.7, 1, 9), 0.65, 1e-12);
  near(steeringOf(2.7, -1, 9), -0.65, 1e-12);
  assert.equal(steeringOf(2.7, 0, 0.5), 0);
  // Around standstill there is no jump.
  let before = steeringOf(2.7, -2, 0.5);
  for (let speed = -2; speed <= 2; speed += 0.001) {
    const now = steeringOf(2.7, speed, 0.5);
    assert.ok(Math.abs(now - before) < 0.003, `${speed}: ${before} ${now}`);
    before = now;
  }
});

test('an invalid screen is refused', () => {
  assert.deepEqual(readSeat('60', '70'), { screen_width_m: 0.6, eye_distance_m: 0.7 });
  for (const [width, distance] of [['', '70'], ['60', ''], ['-60', '70'], ['60', '0'],
    ['x', '70'], ['60', 'Infinity']]) {
    assert.equal(readSeat(width, distance), null);
  }
});

test('a camera is mounted in the turned and climbing vehicle', () => {
  const stand = { x: 100, y: 50, z: 3, yaw: Math.PI / 2, slope: 0 };
  const level = mountedAt(stand, { x: 2, y: 0.5, z: 1 }, 0.1, 0.2);
  near(level.x, 99.5, 1e-9);
  near(level.y, 52, 1e-9);
  near(level.z, 4, 1e-9);
  assert.deepEqual([level.yaw, level.aside, level.pitch], [Math.PI / 2, 0.1, 0.2]);
  // On a slope of 30 degrees: (2, 1) turned by it in the plane of heading and up.
  const steep = mountedAt({ ...stand, slope: 30 * DEGREE }, { x: 2, y: 0.5, z: 1 });
  near(steep.y, 50 + 2 * Math.cos(30 * DEGREE) - Math.sin(30 * DEGREE), 1e-9);
  near(steep.z, 3 + 2 * Math.sin(30 * DEGREE) + Math.cos(30 * DEGREE), 1e-9);
});

test('chase is behind the vehicle, bird above it', () => {
  const stand = { x: 0, y: 0, z: 0, yaw: 0, slope: 0 };
  assert.ok(chasing(stand, -1).x < -5);
  const bird = above(stand);
  assert.ok(bird.z > 30);
  near(bird.pitch, -Math.PI / 2, 1e-9);
});

test('a flat mirror shows the view from the image of the eye behind it', () => {
  const inner = MIRRORS.find(({ name }) => name === 'inner');
  const { point, aside, pitch } = mirrorCamera(inner, PLACE);
  // The eye's image in the glass, whose normal bisects the directions to eye and target.
  const glass = PLACE.inner_mirror;
  const toEye = PLACE.eye.map((value, axis) => value - glass[axis]);
  const distance = Math.hypot(...toEye);
  const sight = [Math.cos(pitch) * Math.cos(aside), Math.cos(pitch) * Math.sin(aside),
    Math.sin(pitch)];
  const sum = toEye.map((value, axis) => value / distance + sight[axis]);
  const normal = sum.map((value) => value / Math.hypot(...sum));
  const off = toEye.reduce((total, value, axis) => total + value * normal[axis], 0);
  const image = PLACE.eye.map((value, axis) => value - 2 * off * normal[axis]);
  near(point.x, image[0], 1e-9);
  near(point.y, image[1], 1e-9);
  near(point.z, image[2], 1e-9);
});

test('outer mirrors are curved and show a wider view than a flat one', () => {
  const left = MIRRORS.find(({ name }) => name === 'left');
  const bent = mirrorCamera(left, PLACE);
  const flat = mirrorCamera({ ...left, radius: Infinity }, PLACE);
  assert.ok(bent.height > 1.5 * flat.height);
  // UN R46 class III: 4 m of road beside the car, 20 m behind the eyes, are in it.
  const across = 2 * Math.atan(Math.tan(bent.height / 2) * bent.aspect);
  const edge = left.aside - across / 2;
  assert.ok(Math.atan2(-4, 20) > edge, `${edge / DEGREE}`);
});

test('the origin is in the middle of the map, in whole metres, and constant', () => {
  const scene = { bounds: [690500.3, 5335000.1, 691000.9, 5335900.7] };
  assert.deepEqual(localOrigin(scene), { x: 690751, y: 5335450 });
  const { x } = localOrigin(scene);
  // From there float32 resolves tenths of millimetres; from the map's zero it does not.
  near(Math.fround(690999.123 - x), 690999.123 - x, 1e-4);
  assert.ok(Math.abs(Math.fround(690999.123) - 690999.123) > 1e-3);
});

test('the quality control finds a pixel ratio within the time for a picture', () => {
  for (const factor of [4, 40, 400]) {
    const quality = new Quality(true, 1);
    const cost = () => 2 + factor * quality.ratio ** 2;
    for (let now_ms = 0; now_ms < 60000; now_ms += 500) {
      quality.adjust(cost(), now_ms);
    }
    assert.ok(cost() <= 16 || quality.ratio <= 0.25, `${factor}: ${quality.ratio}`);
    const settled = quality.ratio;
    for (let now_ms = 60000; now_ms < 90000; now_ms += 500) {
      quality.adjust(cost(), now_ms);
    }
    assert.equal(quality.ratio, settled);
    quality.sharp = true;
    assert.equal(quality.ratio, 1);
  }
  assert.ok(new Quality(true, 1).period_ms > 0);
  assert.equal(new Quality(false, 2).period_ms, 0);
  assert.ok(isSoftware('ANGLE (Google, Vulkan 1.3.0 (SwiftShader Device (Subzero)))'));
  assert.ok(isSoftware('llvmpipe (LLVM 15.0.7, 256 bits)'));
  assert.ok(!isSoftware('ANGLE (NVIDIA Corporation, NVIDIA GeForce RTX 3060/PCIe/SSE2)'));
});

test('detail is dropped when pictures take too long, and returns when they do not', () => {
  for (const software of [true, false]) {
    const quality = new Quality(software, 1);
    let now_ms = 0;
    const settle = (cost_ms) => {
      for (let i = 0; i < 400; i += 1) {
        quality.adjust(cost_ms, now_ms);
        now_ms += 500;
      }
    };
    settle(100);
    assert.equal(quality.detail, DETAILS[DETAILS.length - 1]);
    assert.ok(quality.ratio <= 0.25);
    assert.equal(quality.period_ms, 50);
    settle(1);
    assert.equal(quality.period_ms, software ? 33 : 0);
    assert.equal(quality.detail, DETAILS[0]);
    assert.equal(quality.ratio, 1);
    settle(100);
    quality.sharp = true;
    assert.equal(quality.detail, DETAILS[0]);
  }
});

test('a quality that took too long is retried ever more rarely', () => {
  const quality = new Quality(true, 1);
  const cost = () => (quality.ratio > 0.45 ? 40 : 5);
  const tries = [];
  for (let now_ms = 0; now_ms < 600_000; now_ms += 500) {
    const before = quality.ratio;
    quality.adjust(cost(), now_ms);
    if (quality.ratio > before) {
      tries.push(now_ms);
    }
  }
  assert.ok(tries.length >= 3 && tries.length <= 6, `${tries}`);
  for (let i = 2; i < tries.length; i += 1) {
    assert.ok(tries[i] - tries[i - 1] > 1.8 * (tries[i - 1] - tries[i - 2]), `${tries}`);
  }
});

test('slow software pictures come less often, but at least 20 times a second', () => {
  const quality = new Quality(true, 1);
  quality.adjust(5, 0);
  assert.equal(quality.period_ms, 33);
  quality.adjust(12, 100);
  assert.equal(quality.period_ms, 40);
  quality.adjust(500, 200);
  assert.equal(quality.period_ms, 50);
});

test('a ball is within planes while any part of it is', () => {
  // A cube from -1 to 1.
  const planes = new Float64Array([1, 0, 0, 1, -1, 0, 0, 1, 0, 1, 0, 1, 0, -1, 0, 1, 0, 0, 1, 1,
    0, 0, -1, 1]);
  assert.ok(isWithin(planes, 0, 0, 0, 0));
  assert.ok(isWithin(planes, 1.4, 0, 0, 0.5));
  assert.ok(!isWithin(planes, 1.6, 0, 0, 0.5));
  assert.ok(!isWithin(planes, 0, 0, -1.6, 0.5));
});

test('plain bodies have the size of the others and few triangles', () => {
  const rectangle = (length, width) => ({ kind: 'rectangle', length, width, vertices: [] });
  for (const [type, length] of [['car', 4.5], ['car', 6], ['truck', 12], ['bus', 12]]) {
    const look = ofObject({ id: '7', type, role: 'recorded', shape: rectangle(length, 2) });
    const body = look.build();
    const plain = plainBody(look.key, body);
    assert.ok(plain.triangles < 100 && plain.triangles < 0.6 * body.mesh.triangles, look.key);
    const most = [0, 0, 0];
    for (const painted of [true, false]) {
      plain.arrays(painted).positions.forEach((value, i) => {
        most[i % 3] = Math.max(most[i % 3], Math.abs(value));
      });
    }
    near(2 * most[0], body.length, 0.15, look.key);
    near(2 * most[1], body.width, 0.1, look.key);
    near(most[2], body.height, 0.1, look.key);
  }
  const walker = ofObject({ id: '8', type: 'pedestrian', role: 'recorded',
    shape: rectangle(0.5, 0.5) });
  assert.equal(plainBody(walker.key, walker.build()), null);
});

test('the address sets the view of a window', () => {
  assert.equal(readViewWindow(''), null);
  assert.equal(readViewWindow('?view=kitchen'), null);
  const side = readViewWindow('?view=driver&yaw=-60&vehicle=hv1&fov=50');
  near(side.aside, -60 * DEGREE, 1e-9);
  assert.deepEqual([side.viewpoint, side.vehicle, side.fieldOfView_deg], ['driver', 'hv1', 50]);
  const wrong = readViewWindow('?view=chase&yaw=left&fov=1000');
  assert.deepEqual([wrong.aside, wrong.vehicle, wrong.fieldOfView_deg], [0, null, null]);
});

test('normals point outwards, are smooth on curves and sharp at edges', () => {
  const box = new MeshBuilder().box([-1, -1, -1], [1, 1, 1], [1, 1, 1, true]).arrays(true);
  assert.equal(box.positions.length, 12 * 9);
  for (let i = 0; i < box.positions.length; i += 3) {
    const outward = [0, 1, 2].reduce(
      (sum, axis) => sum + box.positions[i + axis] * box.normals[i + axis], 0);
    near(outward, 1, 1e-6);
  }
  const wheel = new MeshBuilder().cylinder([0, 0, 0], 'y', 1, 1, [1, 1, 1], [1, 1, 1], 24);
  const { positions, normals } = wheel.arrays(false);
  for (let i = 0; i < positions.length; i += 3) {
    const radial = positions[i] * normals[i] + positions[i + 2] * normals[i + 2];
    const axial = 2 * positions[i + 1] * normals[i + 1];
    // On the tyre along the radius, at the ends along the axis.
    near(Math.max(radial, axial), 1, 1e-3);
  }
});

test('lights are on at dusk and in fog', () => {
  for (const [light, visibility, on] of [['day', 30000, false], ['day', 201, false],
    ['day', 200, true], ['day', 80, true], ['dusk', 30000, true], ['dusk', 80, true]]) {
    assert.equal(wantsHeadlights({ light, visibility }), on, `${light} ${visibility}`);
  }
});

test('bodies fit their types and sizes, and few triangles make them', () => {
  const rectangle = (length, width) => ({ kind: 'rectangle', length, width, vertices: [] });
  const keys = [['car', 4.5, 1.8, 'car'], ['car', 6, 2, 'van'], ['truck', 12, 2.5, 'truck'],
    ['bus', 12, 2.5, 'bus'], ['bicycle', 1.8, 0.6, 'bicycle'],
    ['motorcycle', 2.2, 0.8, 'motorcycle'], ['pedestrian', 0.5, 0.5, 'pedestrian']];
  for (const [type, length, width, key] of keys) {
    const look = ofObject({ id: '7', type, role: 'recorded', shape: rectangle(length, width) });
    assert.equal(look.key, key);
    const body = look.build();
    assert.ok(body.mesh.triangles < 900, `${key}: ${body.mesh.triangles}`);
    let [longest, widest] = [0, 0];
    for (const painted of [true, false]) {
      const { positions } = body.mesh.arrays(painted);
      for (let i = 0; i < positions.length; i += 3) {
        longest = Math.max(longest, Math.abs(positions[i]));
        widest = Math.max(widest, Math.abs(positions[i + 1]));
        assert.ok(positions[i + 2] > -0.01);
      }
    }
    assert.ok(2 * longest < body.length + 0.4 && 2 * longest > 0.6 * body.length, key);
    assert.ok(2 * widest < body.width + 0.8, key);
  }
  const skip = ofObject({ id: 'o', type: 'constructionZone', role: 'static',
    shape: { kind: 'polygon', length: 2, width: 1,
      vertices: [-1, -0.5, 1, -0.5, 1, 0.5, -1, 0.5] } });
  assert.equal(skip.build().length, 2);
  const own = ofVehicle({ id: 'hv0', type: 'car', role: 'human', shape: rectangle(4.508, 1.61),
    wheelbase: 2.579, rear_to_center: 1.423, driver_place: PLACE });
  const { wheels, length } = own.build();
  near((wheels.front - wheels.rear) * own.length / length, 2.579, 1e-6);
  near(-wheels.rear * own.length / length, 1.423, 1e-6);
  const ridden = ofVehicle({ id: 'hv0', type: 'bicycle', role: 'human',
    shape: rectangle(1.9, 0.7), wheelbase: 1.05, rear_to_center: 0.525, driver_place: PLACE });
  assert.deepEqual([ridden.key, ridden.build().lamps], ['bicycle', null]);
});
