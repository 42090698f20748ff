// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** What pages tell of their 3D view, against a pinhole by similar triangles. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { close } from './support.mjs';

const VIEW = '../../page/cockpit/js/view3d';
const { eyeOf, mirrorOf, seenBy } = await import(`${VIEW}/contents.js`);
const { boxOf, distanceTo, product, upright } = await import(`${VIEW}/solid_boxes.js`);
const { MeshBuilder } = await import(`${VIEW}/bodies/mesh_builder.js`);

const DEGREE = Math.PI / 180;
const EYE = [3, -2, 1.2];
// Half angles of a picture of 4 to 3 whose height is 60 degrees.
const TALL = Math.tan(30 * DEGREE);
const ACROSS = TALL * 4 / 3;
// The nearest plane of three.js's projection, and its farthest [m].
const [NEAR, FAR] = [0.2, 3000];
const CAR = [[-2.2, -0.9, 0], [2.2, 0.9, 1.4]];

/** Return a view as three.js makes it: from EYE, level, with a heading [rad]. */
function viewOf(yaw) {
  const projection = [1 / ACROSS, 0, 0, 0, 0, 1 / TALL, 0, 0,
    0, 0, -(FAR + NEAR) / (FAR - NEAR), -1, 0, 0, -2 * FAR * NEAR / (FAR - NEAR), 0];
  const axes = [[Math.sin(yaw), -Math.cos(yaw), 0], [0, 0, 1],
    [-Math.cos(yaw), -Math.sin(yaw), 0]];
  const inverse = [0, 1, 2].flatMap((column) => [...axes.map((axis) => axis[column]), 0]);
  const shift = axes.map((axis) => -axis.reduce((sum, value, i) => sum + value * EYE[i], 0));
  return product(projection, [...inverse, ...shift, 1]);
}

/** Return where a pinhole at EYE sees a point, as shares of the picture; depth last. */
function pinhole([x, y, z], yaw) {
  const [dx, dy] = [x - EYE[0], y - EYE[1]];
  const depth = dx * Math.cos(yaw) + dy * Math.sin(yaw);
  const left = dy * Math.cos(yaw) - dx * Math.sin(yaw);
  return [0.5 - left / depth / ACROSS / 2, 0.5 - (z - EYE[2]) / depth / TALL / 2, depth];
}

/** Return a point of an upright car that is given by shares of its size, from 0 to 1. */
function pointOf(x, y, yaw, shares) {
  const [a, l, z] = shares.map((share, i) => CAR[0][i] + share * (CAR[1][i] - CAR[0][i]));
  return [x + a * Math.cos(yaw) - l * Math.sin(yaw), y + a * Math.sin(yaw) + l * Math.cos(yaw), z];
}

const sides = ({ left, top, right, bottom }) => [left, top, right, bottom];

test('the rear of a car ahead is as wide and high as similar triangles have it', () => {
  // Its rear is 20 m ahead, 1.8 m wide and 1.4 m high; the eye is opposite its middle.
  const box = boxOf(viewOf(0), upright(EYE[0] + 22.2, EYE[1], 0, ...CAR));
  close(sides(box), [0.5 - 0.9 / 20 / ACROSS / 2, 0.5 - 0.2 / 20 / TALL / 2,
    0.5 + 0.9 / 20 / ACROSS / 2, 0.5 + 1.2 / 20 / TALL / 2], 1e-9);
});

test('a turned car fills the box around what a pinhole sees of its corners', () => {
  for (const [x, y, yaw, heading] of [[25, 4, 0.5, 0], [40, -20, 2.4, -0.4], [-30, 8, 1, 3]]) {
    const corners = Array.from({ length: 8 }, (_, i) => pinhole(
      pointOf(x, y, yaw, [i & 1, i >> 1 & 1, i >> 2 & 1]), heading));
    const [us, vs] = [corners.map(([u]) => u), corners.map(([, v]) => v)];
    close(sides(boxOf(viewOf(heading), upright(x, y, yaw, ...CAR))),
      [Math.min(...us), Math.min(...vs), Math.max(...us), Math.max(...vs)], 1e-9);
  }
});

test('of a car beside the eye the part ahead counts, and it ends with the picture', () => {
  const [x, y, yaw] = [4, 0.2, 0.1];
  const seen = [];
  for (let a = 0; a <= 1; a += 0.01) {
    for (let l = 0; l <= 1; l += 0.05) {
      for (const z of [0, 0.5, 1]) {
        const [u, v, depth] = pinhole(pointOf(x, y, yaw, [a, l, z]), 0);
        if (depth > 0.05) {
          seen.push([u, v]);
        }
      }
    }
  }
  const cut = (value) => Math.min(Math.max(value, 0), 1);
  const [us, vs] = [seen.map(([u]) => cut(u)), seen.map(([, v]) => cut(v))];
  close(sides(boxOf(viewOf(0), upright(x, y, yaw, ...CAR))),
    [Math.min(...us), Math.min(...vs), Math.max(...us), Math.max(...vs)], 0.01);
  assert.equal(boxOf(viewOf(Math.PI), upright(20, -2, 0, ...CAR)), null);
  assert.equal(boxOf(viewOf(0), upright(20, 60, 0, ...CAR)), null);
});

test('the distance is that to the nearest point of the body, whatever its scale', () => {
  const car = upright(13, 5, Math.PI / 2, ...CAR);
  // It stands across: from x 12.1 to 13.9, and from y 2.8 to 7.2.
  close(distanceTo(car, EYE), Math.hypot(12.1 - 3, 2.8 + 2), 1e-9);
  const small = { matrix: product(car.matrix, [0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0,
    1]), low: CAR[0], high: CAR[1] };
  // Half as large: its roof, at 0.7 m, is below the eye.
  close(distanceTo(small, EYE), Math.hypot(12.55 - 3, 3.9 + 2, 0.5), 1e-9);
  close(distanceTo(car, [13, 5, 1]), 0, 1e-12);
});

test('things come nearest first with their ids; what is out of sight or tiny is left out', () => {
  const things = [[60, 0, 'o3'], [20, 1, 'av0'], [-20, 0, 'o1'], [2900, 0, 'o2']].map(
    ([x, y, id]) => ({ kind: 'vehicle', id, ...upright(x, y, 0, ...CAR) }));
  const seen = seenBy({ view: viewOf(0), eye: EYE }, things);
  assert.deepEqual(seen.map(([kind, id]) => [kind, id]), [['vehicle', 'av0'], ['vehicle', 'o3']]);
  close(seen[0][6], Math.hypot(17.8 - 3, 1 - 0.9 + 2), 0.005);
  assert.equal(seen[0][7], null);
});

test('what is in a mirror is turned over in its glass, and comes before it', () => {
  const things = [{ kind: 'vehicle', id: 'o1', ...upright(-30, 2, 0, ...CAR) }];
  const size = { width: 1000, height: 500 };
  const glass = { left: 100, bottom: 200, width: 200, height: 100 };
  const view = viewOf(Math.PI);
  const [car, mirror] = mirrorOf({ name: 'left', rectangle: glass, view, eye: EYE }, things, size);
  assert.deepEqual(mirror, ['mirror', 'mirror_left', 0.1, 0.4, 0.3, 0.6, null, null]);
  const box = boxOf(view, things[0]);
  // To the right of who looks back: at the left in the mirror.
  assert.ok(box.left > 0.5);
  close(car.slice(2, 6), [0.1 + 0.2 * (1 - box.right), 0.4 + 0.2 * box.top,
    0.1 + 0.2 * (1 - box.left), 0.4 + 0.2 * box.bottom], 1e-4);
  assert.deepEqual([car[1], car[7]], ['o1', 'mirror_left']);
});

test('the eye is told above the road on which the vehicle stands', () => {
  const stand = { x: 10, y: 20, z: 5, yaw: Math.PI / 2, slope: 10 * DEGREE };
  // The eye is 1.2 m above the rear axle, along the vehicle's own upward direction.
  const up = [0, -Math.sin(stand.slope), Math.cos(stand.slope)];
  const forwards = [0, Math.cos(13 * DEGREE), Math.sin(13 * DEGREE)];
  const found = eyeOf(stand, [10, 20 + 1.2 * up[1], 5 + 1.2 * up[2]], forwards, 60 * DEGREE, 2);
  close(found, [10, 20 + 1.2 * up[1], Math.PI / 2, 1.2, 3 * DEGREE, 2 * TALL, TALL], 0.006);
});

test('the box of a mesh holds all its corners', () => {
  const { low, high } = new MeshBuilder().box([-1, -2, 0.3], [1, 2, 3], [1, 1, 1])
    .box([1, 0, 1], [1.5, 0.5, 1.2], [1, 1, 1]).bounds;
  assert.deepEqual([low, high], [[-1, -2, 0.3], [1.5, 2, 3]]);
});
