// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The paths of a map: their places and numbers, each drawn once. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { close, laneletOf, recordPaths } from './support.mjs';

recordPaths();
const { collectBoundaries } = await import(
  '../../page/cockpit/js/world/boundaries.js');
const { buildChunks } = await import('../../page/cockpit/js/world/map_geometry.js');

const chunksOf = (...lanelets) => buildChunks({ lanelets });
const only = (...lanelets) => {
  const chunks = chunksOf(...lanelets);
  assert.equal(chunks.length, 1);
  return chunks[0];
};
const drawn = (path) => path.pieces.filter((piece) => piece.length > 1).length;

test('two neighbours share their line, which is drawn once', () => {
  const lower = laneletOf({ id: 1, adj_left: 2, adj_left_same: true, left_line: 'dashed' });
  const upper = laneletOf({ id: 2, y: 4, adj_right: 1, adj_right_same: true });
  const boundaries = collectBoundaries([lower, upper]);
  assert.deepEqual(boundaries.map(({ owner, marking, inner }) => [owner, marking, inner]),
    [[0, 'dashed', true], [0, 'dashed', false], [1, 'solid', false]]);
});

test('a shared line has the more visible of its two markings', () => {
  const lower = laneletOf({ id: 1, adj_left: 2, adj_left_same: true, left_line: 'dashed' });
  const upper = laneletOf({ id: 2, y: 4, adj_right: 1, adj_right_same: true,
    right_line: 'solid' });
  assert.equal(collectBoundaries([lower, upper])[0].marking, 'solid');
});

test('with oncoming traffic the left line is shared, in the other direction', () => {
  const there = laneletOf({ id: 1, adj_left: 2, adj_left_same: false });
  const back = { ...laneletOf({ id: 2, adj_left: 1, adj_left_same: false }),
    left: [100, 2, 0, 2], right: [100, 6, 0, 6] };
  assert.equal(collectBoundaries([there, back]).length, 3);
});

test('neighbours with a space between them have separate lines', () => {
  const lower = laneletOf({ id: 1, adj_left: 2, adj_left_same: true });
  const upper = laneletOf({ id: 2, y: 5, adj_right: 1, adj_right_same: true });
  assert.equal(collectBoundaries([lower, upper]).length, 4);
  // A neighbour that is not in the scene shares nothing.
  assert.equal(collectBoundaries([lower]).length, 2);
});

test('lanes that split or merge share no line', () => {
  const lower = laneletOf({ id: 1, adj_left: 2, adj_left_same: true });
  const upper = { ...laneletOf({ id: 2, adj_right: 1, adj_right_same: true }),
    left: [0, 6, 100, 30] };
  assert.equal(collectBoundaries([lower, { ...upper, right: [0, 2, 100, 9] }]).length, 4);
  assert.equal(collectBoundaries([lower, { ...upper, right: [0, 9, 100, 2] }]).length, 4);
});

test('lanelets near each other are one chunk, around a point of theirs', () => {
  const far = 5_600_000;
  const near = laneletOf({ id: 1, y: far });
  const chunk = only(near, laneletOf({ id: 2, y: far + 4 }));
  assert.deepEqual(chunk.box, [0, far - 2, 100, far + 6]);
  const [xmin, ymin, xmax, ymax] = chunk.surfaces.get('road').box;
  // Small numbers, so that float32 suffices: 50 m around the first lanelet's middle.
  assert.deepEqual([xmin, ymin, xmax, ymax], [-50, -2, 50, 6]);
  assert.equal(chunksOf(near, laneletOf({ id: 2, y: far + 1000 })).length, 2);
  // Cells of 120 m: by the middle of their boxes these are in the first, and one beside it.
  const around = (x, y) => laneletOf({ left: [x - 5, y + 2, x + 5, y + 2],
    right: [x - 5, y - 2, x + 5, y - 2], center: [x - 5, y, x + 5, y] });
  const cells = (...places) => chunksOf(...places.map(([x, y]) => around(x, y))).length;
  assert.deepEqual([cells([1, 1], [119, 119]), cells([1, 1], [121, 1]), cells([1, 1], [1, 121])],
    [1, 2, 2]);
  // Lanes symmetric about the origin are in different cells.
  const at = (y) => laneletOf({ id: y, y });
  assert.equal(chunksOf(at(1000), at(-1000)).length, 2);
});

test('each surface has its own path, by the types of the lanelet', () => {
  const chunk = only(laneletOf(), laneletOf({ id: 2, y: 5, types: ['sidewalk'] }),
    laneletOf({ id: 3, y: 10, types: ['urban', 'bicycleLane'] }),
    laneletOf({ id: 4, y: 15, intersection: true }),
    laneletOf({ id: 5, y: 20, types: ['shoulder'] }));
  assert.deepEqual([...chunk.surfaces.keys()].toSorted(),
    ['cycle', 'junction', 'parking', 'road', 'walk']);
  assert.equal(chunk.casing.closed, 5);
});

test('an arrow for about every 32 m, none at crossings, on short or two-way lanes', () => {
  const arrows = (more) => only(laneletOf(more)).arrows.closed;
  assert.deepEqual([8, 9, 40, 50, 100].map((length) => arrows({ length })), [0, 1, 1, 2, 3]);
  assert.equal(arrows({ one_way: false }), 0);
  assert.equal(arrows({ intersection: true }), 0);
  assert.equal(arrows({ types: ['sidewalk'] }), 0);
});

test('arrows are evenly spaced, half a spacing from the ends, and turned as the lane is', () => {
  // 100 m in the direction of 30 degrees: three arrows, of which the middles are at these metres.
  const along = (s, aside = 0) => [s * Math.sqrt(3) / 2 - aside / 2,
    s / 2 + aside * Math.sqrt(3) / 2];
  const line = (aside) => [...along(0, aside), ...along(100, aside)];
  const chunk = only(laneletOf({ left: line(2), right: line(-2), center: line(0) }));
  const found = chunk.arrows.pieces.map((piece) => {
    const tip = piece[3];
    const tail = [(piece[0][0] + piece[6][0]) / 2, (piece[0][1] + piece[6][1]) / 2];
    return [tail, tip].map(([x, y]) => [x + chunk.x, y + chunk.y]);
  });
  [100 / 6, 50, 500 / 6].forEach((s, i) => {
    close(found[i][0], along(s - 1.8), 1e-9);
    close(found[i][1], along(s + 1.8), 1e-9);
  });
});

test('an arrow is 3.6 m long and points along its lane', () => {
  const north = { left: [-2, 0, -2, 20], right: [2, 0, 2, 20], center: [0, 0, 0, 20] };
  const [xmin, ymin, xmax, ymax] = only(laneletOf(north)).arrows.box;
  close([xmax - xmin, ymax - ymin], [0.84, 3.6]);
  const tip = only(laneletOf(north)).arrows.pieces[0].find(([, y]) => Math.abs(y - ymax) < 1e-9);
  close(tip[0], 0, 1e-9);
});

test('zebra stripes of half a metre, half a metre apart', () => {
  // From 0.25 m on, one a metre, the last one ending before 4 m: at 0.25, 1.25, 2.25, 3.25.
  const { zebras } = only(laneletOf({ length: 4, types: ['crosswalk'] }));
  assert.equal(zebras.closed, 4);
  const [xmin, ymin, xmax, ymax] = zebras.box;
  close([xmax - xmin, ymin, ymax], [3.5, -2, 2]);
  // The shorter bound limits their number.
  const wedge = { left: [0, 2, 4, 2], right: [0, -2, 2, -2], types: ['crosswalk'] };
  assert.equal(only(laneletOf(wedge)).zebras.closed, 2);
});

test('every marking is put into its path', () => {
  const paths = (marking) => {
    const chunk = only(laneletOf({ left_line: marking, right_line: 'no_marking' }));
    return ['lines', 'broad', 'curbs', 'seams'].map((name) => drawn(chunk[name]));
  };
  assert.deepEqual(paths('solid'), [1, 0, 0, 0]);
  // 100 m of dashes begin every 9 m: twelve. Broad ones, every 6 m: seventeen.
  assert.deepEqual(paths('dashed'), [12, 0, 0, 0]);
  assert.deepEqual(paths('broad_solid'), [0, 1, 0, 0]);
  assert.deepEqual(paths('broad_dashed'), [0, 17, 0, 0]);
  assert.deepEqual(paths('curb'), [0, 0, 1, 0]);
  assert.deepEqual(paths('lowered_curb'), [0, 0, 1, 0]);
  assert.deepEqual(paths('solid_solid'), [2, 0, 0, 0]);
  assert.deepEqual(paths('solid_dashed'), [13, 0, 0, 0]);
  assert.deepEqual(paths('unknown'), [0, 0, 0, 0]);
});

test('a double line: the two are 26 cm apart', () => {
  const { lines } = only(laneletOf({ left_line: 'solid_solid', right_line: 'no_marking' }));
  const [upper, lower] = lines.pieces.map((piece) => piece[0][1]);
  close([upper - lower, (upper + lower) / 2], [0.26, 2]);
});

test('lanes side by side without a line are told apart by a seam, but not at crossings', () => {
  const seams = (intersection) => drawn(only(
    laneletOf({ id: 1, adj_left: 2, adj_left_same: true, left_line: 'no_marking', intersection }),
    laneletOf({ id: 2, y: 4, adj_right: 1, adj_right_same: true, right_line: 'no_marking',
      intersection })).seams);
  assert.deepEqual([seams(false), seams(true)], [1, 0]);
});
