// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The camera: map and canvas agree, and the point under the hand stays in place. */

import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { close } from './support.mjs';

let still = false;
globalThis.window = { matchMedia: () => ({ get matches() { return still; } }) };
const { Camera } = await import('../../page/cockpit/js/world/camera.js');
const { Navigation } = await import('../../page/cockpit/js/world/navigation.js');

const WIDTH = 800;
const HEIGHT = 600;
const BOX = [0, 0, 400, 100];

beforeEach(() => {
  still = false;
});

function made() {
  const camera = new Camera();
  camera.resize(WIDTH, HEIGHT);
  return camera;
}

const onCanvas = (camera, x, y) => [camera.toX(x, y), camera.toY(x, y)];

test('north up: east is right and north is up, at so many pixels a metre', () => {
  const camera = made();
  camera.lookAt(100, 200, false);
  close(onCanvas(camera, 100, 200), [400, 300]);
  const [x, y] = onCanvas(camera, 101, 203);
  close([x - 400, 300 - y], [camera.scale, 3 * camera.scale]);
});

test('a canvas point and its map point agree, for any rotation', () => {
  const camera = made();
  camera.lookAt(3000, -70, false);
  for (const angle of [0, 0.3, 2, -1.1]) {
    camera.rotate(angle, 123, 456);
    close(onCanvas(camera, ...camera.toMap(17, 590)), [17, 590], 1e-6);
  }
});

test('a box is shown whole, as large as possible, in the middle', () => {
  const camera = made();
  camera.fit(BOX, false);
  // 400 m in 92 % of 800 px.
  close(camera.scale, 0.92 * 800 / 400);
  close(onCanvas(camera, 200, 50), [400, 300]);
  camera.fit([0, 0, 1, 1], false);
  // Nothing is shown larger than 10 m high.
  close(camera.scale, 0.92 * 600 / 10);
});

test('the covered lower part of the canvas is not used', () => {
  const camera = made();
  camera.resize(WIDTH, HEIGHT, 200);
  camera.fit([0, 0, 100, 100], false);
  close(camera.scale, 0.92 * 400 / 100);
  close(onCanvas(camera, 50, 50), [400, 200]);
});

test('zooming keeps the point under the hand', () => {
  const camera = made();
  camera.fit(BOX, false);
  const held = camera.toMap(650, 100);
  const before = camera.scale;
  camera.zoom(1.7, 650, 100);
  close(camera.scale, 1.7 * before);
  close(onCanvas(camera, ...held), [650, 100], 1e-9);
});

test('the scale has its limits', () => {
  const camera = made();
  camera.zoom(1e9);
  assert.equal(camera.scale, 120);
  camera.zoom(1e-9);
  close(camera.scale, 0.02);
});

test('dragging moves the map with the hand, turned or not', () => {
  const camera = made();
  camera.fit(BOX, false);
  for (const angle of [0, 0.7, -2]) {
    camera.rotate(angle);
    const held = camera.toMap(300, 200);
    camera.pan(35, -12);
    close(onCanvas(camera, ...held), [335, 188], 1e-9);
  }
});

test('a turn by a right angle moves a point from right of the centre to above it', () => {
  const camera = made();
  camera.fit(BOX, false);
  const [pivot, aside] = [camera.toMap(200, 300), camera.toMap(250, 300)];
  camera.rotate(Math.PI / 2, 200, 300);
  close(onCanvas(camera, ...pivot), [200, 300], 1e-9);
  close(onCanvas(camera, ...aside), [200, 250], 1e-9);
});

test('a vehicle followed heading up drives upwards at four fifths of the height', () => {
  const camera = made();
  const yaw = 0.4;
  camera.beginFollowing({ x: 50, y: 60, yaw, speed: 0 }, true, true, false);
  close(onCanvas(camera, 50, 60), [400, 0.8 * 600]);
  // 70 m of road fit into the height.
  close(camera.scale, 600 / 70);
  close(onCanvas(camera, 50 + Math.cos(yaw), 60 + Math.sin(yaw)), [400, 480 - 600 / 70], 1e-9);
  camera.track(70, 80, 1);
  camera.update(1000);
  close(onCanvas(camera, 70, 80), [400, 480], 1e-9);
  assert.ok(camera.headingUp);
  camera.rotate(0.1);
  assert.ok(!camera.headingUp, 'whoever turns the map by hand wants it so');
});

test('more road is shown at higher speed', () => {
  const camera = made();
  camera.beginFollowing({ x: 0, y: 0, yaw: 0, speed: 25 }, true, true, false);
  close(camera.scale, 600 / (70 + 2.8 * 25));
});

test('gliding: after 90 ms 1/e of the way remains, and it ends exactly', () => {
  const camera = made();
  camera.lookAt(0, 0, false);
  camera.update(1000);
  camera.lookAt(300, 0);
  close(camera.x, 0);
  assert.ok(camera.moves);
  camera.update(1090);
  close(camera.x, 300 * (1 - 1 / Math.E), 1e-6);
  camera.update(5000);
  assert.equal(camera.x, 300);
  assert.ok(!camera.moves);
});

test('zooming out glides evenly: by factors, not by differences', () => {
  const camera = made();
  camera.update(1000);
  const from = camera.scale;
  camera.zoom(4, undefined, undefined, true);
  camera.update(1000 + 90 * Math.LN2);
  close(camera.scale, from * 2, 1e-9);
});

test('turning back to north takes the shortest way', () => {
  const camera = made();
  camera.rotate(-3);
  camera.rotate(-3);
  camera.update(1000);
  camera.northUp();
  camera.update(1000 + 90 * Math.LN2);
  // 6 rad are 2 pi - 6 = 0.28 rad the other way round; half of that is left.
  close(Math.abs(camera.up - Math.PI / 2), (2 * Math.PI - 6) / 2, 1e-9);
});

test('with reduced motion the camera does not glide', () => {
  still = true;
  const camera = made();
  camera.lookAt(300, 0);
  assert.equal(camera.x, 300);
});

test('a canvas that changes its size keeps the map where it is', () => {
  const camera = made();
  camera.fit(BOX, false);
  const corner = camera.toMap(400, 0);
  camera.resize(1000, 700, 100);
  close(onCanvas(camera, ...corner), [500, 0], 1e-9);
});

test('the visible area is bounded by the corners of the canvas', () => {
  const camera = made();
  camera.lookAt(10, 20, false);
  for (const angle of [0, 0.5, 1.9, -2.5]) {
    camera.rotate(angle);
    const corners = [[0, 0], [WIDTH, 0], [0, HEIGHT], [WIDTH, HEIGHT]].map(
      ([px, py]) => camera.toMap(px, py));
    const [xs, ys] = [corners.map(([x]) => x), corners.map(([, y]) => y)];
    close([camera.left, camera.bottom, camera.right, camera.top],
      [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)], 1e-9);
  }
});

test('visibility is checked by radius and by box; absent vehicles are not visible', () => {
  const camera = made();
  camera.lookAt(0, 0, false);
  const { right } = camera;
  assert.ok(camera.sees(right + 4, 0, 5));
  assert.ok(!camera.sees(right + 6, 0, 5));
  assert.ok(!camera.sees(NaN, NaN, 5));
  assert.ok(camera.seesBox([right - 1, 0, right + 9, 1]));
  assert.ok(!camera.seesBox([right + 1, 0, right + 9, 1]));
  const { bottom, left, top } = camera;
  assert.ok(!camera.seesBox([left - 9, 0, left - 1, 1]));
  assert.ok(!camera.seesBox([0, top + 1, 1, top + 9]));
  assert.ok(!camera.seesBox([0, bottom - 9, 1, bottom - 1]));
});

/** Compute where a context that was set up draws a point. */
const drawnAt = ([a, b, c, d, e, f], x, y) => [a * x + c * y + e, b * x + d * y + f];

test('a context draws in metres around a point, and at a pose', () => {
  const camera = made();
  camera.lookAt(5_000_000, 20, false);
  camera.rotate(0.6);
  let matrix;
  const context = { setTransform: (...values) => { matrix = values; } };
  camera.enterMap(context, 2, 5_000_010, 30);
  close(drawnAt(matrix, 3, 4), onCanvas(camera, 5_000_013, 34).map((px) => 2 * px), 1e-5);
  const yaw = 0.25;
  camera.enterPose(context, 2, 5_000_010, 30, yaw, 1.5, 4);
  // A point 2 m before the pose and 4 m to its left, enlarged by 1.5 and 4 px further down.
  const [x, y] = onCanvas(camera, 5_000_010 + 3 * Math.cos(yaw) - 6 * Math.sin(yaw),
    30 + 3 * Math.sin(yaw) + 6 * Math.cos(yaw));
  close(drawnAt(matrix, 2, 4), [2 * x, 2 * (y + 4)], 1e-5);
});

const SCENE = { id: 'a', bounds: BOX, vehicles: [{ id: 'hv0' }, { id: 'av0' }] };

test('following cycles through all driven vehicles', () => {
  const navigation = new Navigation(made(), () => {});
  navigation.load(SCENE, true);
  const followed = [navigation.followed];
  for (let i = 0; i < 3; i += 1) {
    navigation.followNext();
    followed.push(navigation.followed);
  }
  assert.deepEqual(followed, ['hv0', 'av0', 'hv0', 'av0']);
  navigation.fit();
  assert.equal(navigation.followed, null);
  navigation.followNext();
  assert.equal(navigation.followed, 'hv0');
});

test('the same map again keeps the view; another map is shown whole', () => {
  const camera = made();
  const navigation = new Navigation(camera, () => {});
  navigation.load(SCENE, false);
  assert.equal(navigation.followed, null);
  camera.zoom(3);
  const { scale } = camera;
  navigation.load({ ...SCENE, vehicles: [] }, false);
  assert.equal(camera.scale, scale);
  navigation.load({ ...SCENE, id: 'b' }, false);
  close(camera.scale, 0.92 * 800 / 400);
});

test('keys glide, and hands do not', () => {
  const camera = made();
  const navigation = new Navigation(camera, () => {});
  navigation.load(SCENE, false);
  camera.update(1000);
  const glides = (move) => {
    move();
    const moves = camera.moves;
    camera.update(9e9);
    return moves;
  };
  assert.deepEqual([() => navigation.zoomBy(2), () => navigation.turnBy(1),
    () => navigation.fit(), () => navigation.fit(false), () => navigation.hands.pan(1, 1),
    () => navigation.hands.zoom(2, 0, 0), () => navigation.hands.rotate(1, 0, 0)].map(glides),
  [true, true, true, false, false, false, false]);
});

test('zooming is about the hand, or about the followed vehicle', () => {
  const camera = made();
  const navigation = new Navigation(camera, () => {});
  navigation.load(SCENE, false);
  const held = camera.toMap(100, 100);
  navigation.hands.zoom(2, 100, 100);
  close(onCanvas(camera, ...held), [100, 100], 1e-9);
  navigation.follow('hv0', false);
  navigation.steer({ x: 7, y: 8, yaw: 0, speed: 0 }, false);
  navigation.hands.zoom(2, 100, 100);
  close(onCanvas(camera, 7, 8), [400, 300], 1e-9);
});

test('heading up and north up alternate; without a vehicle only north up exists', () => {
  still = true;
  const camera = made();
  const navigation = new Navigation(camera, () => {});
  navigation.load(SCENE, true);
  const pose = { x: 0, y: 0, yaw: 0.3, speed: 0 };
  const look = () => {
    navigation.steer(pose, false);
    return [navigation.headingUp, camera.up];
  };
  assert.deepEqual(look(), [true, 0.3]);
  navigation.toggleHeading();
  assert.deepEqual(look(), [false, Math.PI / 2]);
  navigation.toggleHeading();
  assert.deepEqual(look(), [true, 0.3]);
  navigation.hands.pan(1, 1);
  navigation.toggleHeading();
  assert.deepEqual([navigation.headingUp, camera.up], [false, Math.PI / 2]);
});

test('bringing a vehicle back chooses a new scale; following it again does not', () => {
  const camera = made();
  const navigation = new Navigation(camera, () => {});
  navigation.load(SCENE, true);
  const pose = { x: 0, y: 0, yaw: 0, speed: 0 };
  navigation.steer(pose, false);
  const { scale } = camera;
  camera.zoom(2);
  navigation.follow('hv0');
  navigation.steer(pose, false);
  close(camera.scale, 2 * scale);
  navigation.recenter();
  navigation.steer(pose, false);
  close(camera.scale, scale);
});

test('two fingers zoom and never turn a map whose heading is up', () => {
  const camera = made();
  const navigation = new Navigation(camera, () => {});
  navigation.load(SCENE, true);
  navigation.steer({ x: 0, y: 0, yaw: 0.3, speed: 0 }, false);
  navigation.hands.rotate(0.1, 10, 10);
  assert.ok(navigation.headingUp);
  // One finger with shift does.
  navigation.hands.rotate(0.1);
  assert.ok(!navigation.headingUp);
  assert.equal(navigation.followed, 'hv0');
  navigation.hands.pan(5, 5);
  assert.equal(navigation.followed, null);
});
