// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Lengths, poses, dashes and outlines of lines with known geometry. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { boxOf, outlineOf } from '../../page/cockpit/js/outline.js';
import { roundStep } from '../../page/cockpit/js/world/map_layer.js';
import { addDashes, addLine, addPolygon, lengthOf, poseAlong, shifted } from
  '../../page/cockpit/js/world/polyline.js';
import { close, PathRecorder } from './support.mjs';

// 3 m east, then 4 m north.
const HOOK = [10, 20, 13, 20, 13, 24];

test('lengths', () => {
  assert.equal(lengthOf(HOOK), 7);
  assert.equal(lengthOf([0, 0, 3, 4]), 5);
  assert.equal(lengthOf([1, 1]), 0);
});

test('poses along a line, and at its end beyond it', () => {
  const at = (distance) => Object.values(poseAlong(HOOK, distance));
  close(at(0), [10, 20, 0]);
  close(at(1), [11, 20, 0]);
  close(at(5), [13, 22, Math.PI / 2]);
  close(at(7), [13, 24, Math.PI / 2]);
  close(at(99), [13, 24, Math.PI / 2]);
});

test('a repeated point has the heading of the following segment', () => {
  close(Object.values(poseAlong([0, 0, 0, 0, 0, 2], 0)), [0, 0, Math.PI / 2]);
  close(Object.values(poseAlong([5, 6], 1)), [5, 6, 0]);
});

test('to the left of east is north', () => {
  close(shifted([0, 0, 10, 0], 2), [0, 2, 10, 2]);
  close(shifted([0, 0, 0, 10], 2), [-2, 0, -2, 10]);
  close(shifted([0, 0, 10, 0], -2), [0, -2, 10, -2]);
});

test('an inward offset of a circle is a smaller circle', () => {
  const circle = Array.from({ length: 41 }, (_, i) => i * Math.PI / 80)
    .flatMap((angle) => [50 * Math.cos(angle), 50 * Math.sin(angle)]);
  const inner = shifted(circle, 10);
  // Except at the ends, which have the direction of the first chord.
  for (let i = 2; i < inner.length - 2; i += 2) {
    close(Math.hypot(inner[i], inner[i + 1]), 40, 1e-9);
  }
});

test('dashes of 3 m with gaps of 6 m on 20 m: at 0, 9 and 18, the last cut at the end', () => {
  const path = new PathRecorder();
  addDashes(path, [100, 50, 120, 50], 100, 50, 3, 6);
  const drawn = path.pieces.filter((piece) => piece.length > 1);
  assert.deepEqual(drawn, [[[0, 0], [3, 0]], [[9, 0], [12, 0]], [[18, 0], [20, 0]]]);
});

test('dashes go round a corner, and are as long as on a straight line', () => {
  const path = new PathRecorder();
  addDashes(path, [0, 0, 10, 0, 10, 10], 0, 0, 3, 6);
  assert.deepEqual(path.pieces.filter((piece) => piece.length > 1)[1],
    [[9, 0], [10, 0], [10, 2]]);
  close(path.lengths, [3, 3, 2]);
});

test('dashes do not depend on the spacing of a line\'s points', () => {
  const lengths = [1, 7, 20, 101].map((count) => {
    const line = Array.from({ length: count + 1 }, (_, i) => [100 * i / count, 0]).flat();
    const path = new PathRecorder();
    addDashes(path, line, 0, 0, 3, 6);
    return path.lengths;
  });
  lengths.forEach((found) => close(found, lengths[0], 1e-9));
  // Begun every 9 m within 100 m: twelve times, and the last has one metre left.
  close(lengths[0], [...Array(11).fill(3), 1]);
});

test('lines and polygons are drawn around a point', () => {
  const path = new PathRecorder();
  addLine(path, HOOK, 10, 20);
  assert.deepEqual(path.pieces, [[[0, 0], [3, 0], [3, 4]]]);
  assert.equal(path.closed, 0);
  addPolygon(path, HOOK, 0, 0);
  assert.equal(path.closed, 1);
});

test('the outline of a lanelet goes along its left and back along its right bound', () => {
  const outline = outlineOf({ left: [0, 2, 5, 2, 10, 2], right: [0, -2, 10, -2] });
  assert.deepEqual(outline, [0, 2, 5, 2, 10, 2, 10, -2, 0, -2]);
});

test('boxes', () => {
  assert.deepEqual(boxOf([1, -2, 3, 4, -5, 0]), [-5, -2, 3, 4]);
  assert.deepEqual(boxOf([7, 8]), [7, 8, 7, 8]);
});

test('the spacing of the grid: 1, 2 or 5 times a power of ten, and never smaller', () => {
  close([1, 1.01, 2, 3, 5, 5.1, 0.03, 999].map(roundStep), [1, 2, 2, 5, 5, 10, 0.05, 1000]);
});
