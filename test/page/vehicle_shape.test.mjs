// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Shapes of vehicles and obstacles: true sizes, and the parts of each kind. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { close, recordPaths } from './support.mjs';

recordPaths();
const { vehicleLook, TYRE } = await import(
  '../../page/cockpit/js/world/vehicle_shape.js');

const rectangle = (length, width) => ({ kind: 'rectangle', length, width, vertices: [] });
const parts = (look) => ['glass', 'roof', 'lamps', 'brakes'].filter((name) => look[name]);

test('a car has its length and width, but for the bow of its bumper', () => {
  const { body, extent, radius } = vehicleLook('car', rectangle(4.5, 1.8), true);
  const [xmin, ymin, xmax, ymax] = body.box;
  close([xmin, ymin, ymax], [-2.25, -0.9, 0.9]);
  // The control point of the bow is one per cent of half its width before it.
  close(xmax, 2.25, 0.01 * 0.9 + 1e-9);
  assert.equal(extent, 4.5);
  close(radius, Math.hypot(2.25, 0.9));
});

for (const [type, length, width] of [['truck', 12, 2.5], ['bus', 18, 2.5]]) {
  test(`a ${type} has its length and width`, () => {
    const look = vehicleLook(type, rectangle(length, width), true);
    close(look.body.box, [-length / 2, -width / 2, length / 2, width / 2]);
    assert.deepEqual(parts(look), ['glass', 'lamps', 'brakes']);
  });
}

test('only a truck has a gap between cab and load', () => {
  const glass = (type) => vehicleLook(type, rectangle(12, 2.5), true).glass.pieces.length;
  assert.deepEqual([glass('truck'), glass('bus')], [2, 1]);
});

test('lamps are at the front and brake lights at the back, within the outline', () => {
  for (const type of ['car', 'truck']) {
    const { lamps, brakes } = vehicleLook(type, rectangle(5, 2), true);
    assert.ok(lamps.box[0] > 0 && lamps.box[2] <= 2.5, `${lamps.box}`);
    assert.ok(brakes.box[2] < 0 && brakes.box[0] >= -2.5, `${brakes.box}`);
    for (const { box } of [lamps, brakes]) {
      close(box[1] + box[3], 0, 1e-9);
      assert.ok(box[3] > 0.8 && box[3] <= 1, `at the sides: ${box}`);
    }
  }
});

test('a windscreen is in the front half, so that the heading is visible', () => {
  const { glass, roof } = vehicleLook('car', rectangle(4.5, 1.8), true);
  assert.ok(glass.box[2] > roof.box[2], 'before the roof');
});

test('a shape unlike a car is a block with a nose, or without one if static', () => {
  assert.deepEqual(parts(vehicleLook('car', rectangle(12, 1.8), true)), ['glass']);
  assert.deepEqual(parts(vehicleLook('unknown', rectangle(4, 4), false)), []);
  assert.deepEqual(parts(vehicleLook('car', rectangle(4.5, 1.8), false)), []);
  assert.equal(parts(vehicleLook('parkedVehicle', rectangle(4.5, 1.8), false)).length, 4);
});

test('a nose points ahead, within the block and in its front third', () => {
  const [tip, ...base] = vehicleLook('car', rectangle(12, 1.8), true).glass.pieces[0];
  assert.ok(base.every(([x]) => x < tip[0]));
  close(tip[1], 0);
  assert.ok([tip, ...base].every(([x, y]) => x > 2 && x <= 6 && Math.abs(y) <= 0.9));
});

test('glass and roof lie within the outline of a car', () => {
  const { body, glass, roof } = vehicleLook('car', rectangle(4.5, 1.8), true);
  for (const { box } of [glass, roof]) {
    assert.ok(box[0] > body.box[0] && box[2] < body.box[2], `${box}`);
    assert.ok(box[1] > body.box[1] && box[3] < body.box[3], `${box}`);
    close(box[1] + box[3], 0, 1e-9);
  }
});

test('a circle and a polygon keep their shape', () => {
  const pillar = { kind: 'circle', length: 3, width: 3, vertices: [] };
  const { body } = vehicleLook('pillar', pillar, false);
  assert.deepEqual(body.arcs, [{ x: 0, y: 0, rx: 1.5, ry: 1.5 }]);
  const triangle = { kind: 'polygon', length: 2, width: 1, vertices: [-1, 0, 1, 0.5, 1, -0.5] };
  const block = vehicleLook('building', triangle, false).body;
  assert.deepEqual(block.pieces, [[[-1, 0], [1, 0.5], [1, -0.5]]]);
  assert.equal(block.closed, 1);
});

test('a pedestrian is an ellipse of its size, and a nose that points ahead', () => {
  const { body } = vehicleLook('pedestrian', rectangle(0.4, 0.6), true);
  const [base, tip, other] = body.pieces.at(-1);
  close([base[0] - other[0], base[1] + other[1], tip[1]], [0, 0, 0]);
  assert.ok(tip[0] > base[0] && Math.abs(base[1]) < 0.3);
  assert.deepEqual(body.arcs[0], { x: 0, y: 0, rx: 0.2, ry: 0.3 });
  assert.ok(body.box[2] > 0.2);
});

test('a bicycle has its length, and its handlebar its width', () => {
  const { body } = vehicleLook('bicycle', rectangle(1.8, 0.7), true);
  const [xmin, ymin, xmax, ymax] = body.box;
  close([xmin, ymin, xmax, ymax], [-0.9, -0.35, 0.9, 0.35]);
});

test('a tyre is around its own centre', () => {
  const [xmin, ymin, xmax, ymax] = TYRE.box;
  close([xmin + xmax, ymin + ymax], [0, 0]);
  assert.ok(xmax - xmin > ymax - ymin);
});
