// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Objects beside roads of the 3D view: never on a road or in a driver's line of sight. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { close, laneletOf } from './support.mjs';

const JS = '../../page/cockpit/js';
const { contrastLeft, extinction } = await import(`${JS}/view3d/road/fog.js`);
const { blocksOf } = await import(`${JS}/view3d/road/obstacles.js`);
const { placeLights, placeSigns } = await import(`${JS}/view3d/road/poles.js`);
const { heightOn, RoadIndex } = await import(`${JS}/view3d/road/road_index.js`);
const { placeRoadside, SIGHT_M, stationsOf } = await import(`${JS}/view3d/road/roadside.js`);
const { faceOf, speedText } = await import(`${JS}/view3d/road/sign_faces.js`);

/** A winding road, 5 m wide, in consecutive parts of 60 m, and one road across it. */
function winding(more = {}) {
  const at = (s, d) => {
    const [y, slope] = [40 * Math.sin(s / 70), 40 / 70 * Math.cos(s / 70)];
    const norm = Math.hypot(1, slope);
    return [s - d * slope / norm, y + d / norm];
  };
  const line = (from, d) => Array.from({ length: 21 }, (_, i) => at(from + 3 * i, d)).flat();
  const lanelets = Array.from({ length: 12 }, (_, i) => laneletOf({ id: i,
    left: line(60 * i, 2.5), right: line(60 * i, -2.5), center: line(60 * i, 0),
    successors: i < 11 ? [i + 1] : [], types: ['country'], speed_limit: null, ...more }));
  lanelets.push(laneletOf({ id: 99, left: [298, -200, 298, 200], right: [302, -200, 302, 200],
    center: [300, -200, 300, 200], types: ['country'], speed_limit: null, ...more }));
  return { id: 'winding', bounds: [0, -200, 720, 200], lanelets };
}

/** Check whether a point is in a polygon, by the winding angle around the point. */
function isIn({ left, right }, x, y) {
  const ring = [];
  for (let i = 0; i < left.length; i += 2) {
    ring.push([left[i] - x, left[i + 1] - y]);
  }
  for (let i = right.length - 2; i >= 0; i -= 2) {
    ring.push([right[i] - x, right[i + 1] - y]);
  }
  const turned = ring.reduce((sum, [ax, ay], i) => {
    const [bx, by] = ring[(i + 1) % ring.length];
    return sum + Math.atan2(ax * by - ay * bx, ax * bx + ay * by);
  }, 0);
  return Math.abs(turned) > Math.PI;
}

const placed = (scene) => placeRoadside(scene, new RoadIndex(scene.lanelets));

test('nothing stands on a lanelet', () => {
  for (const scene of [winding(), winding({ types: ['urban'], speed_limit: 13.9 })]) {
    const roadside = placed(scene);
    const all = Object.values(roadside).flat();
    assert.ok(all.length > 300);
    for (const { x, y, size: [length, width], yaw } of all) {
      // Middles and corners of their ground areas.
      for (const [a, b] of [[0, 0], [0.5, 0.5], [0.5, -0.5], [-0.5, 0.5], [-0.5, -0.5]]) {
        const px = x + (length > 1 ? a * length * Math.cos(yaw) - b * width * Math.sin(yaw) : 0);
        const py = y + (length > 1 ? a * length * Math.sin(yaw) + b * width * Math.cos(yaw) : 0);
        assert.ok(!scene.lanelets.some((lanelet) => isIn(lanelet, px, py)), `${px} ${py}`);
      }
    }
  }
});

test('houses hide no part of the surrounding roads from another part', () => {
  const scene = winding({ types: ['urban'], speed_limit: 13.9 });
  const { houses } = placed(scene);
  assert.ok(houses.length > 20);
  const points = scene.lanelets.flatMap(({ center }) => center.flatMap(
    (x, i) => (i % 2 === 0 ? [[x, center[i + 1]]] : [])));
  for (const { x, y, yaw, size: [length, width] } of houses) {
    // In the house's own frame, its front at -length / 2.
    const near = points.map(([px, py]) => [
      (px - x) * Math.cos(yaw) + (py - y) * Math.sin(yaw),
      (py - y) * Math.cos(yaw) - (px - x) * Math.sin(yaw)])
      .filter(([a, b]) => Math.hypot(a + length / 2, b) < SIGHT_M - 1);
    for (const [ax, ay] of near) {
      for (const [bx, by] of near) {
        for (let share = 0; share <= 1; share += 0.05) {
          const [px, py] = [ax + share * (bx - ax), ay + share * (by - ay)];
          assert.ok(Math.abs(px) > length / 2 - 1e-6 || Math.abs(py) > width / 2 - 1e-6);
        }
      }
    }
  }
});

test('posts stand every 50 m on both sides, through all parts of a road', () => {
  const lanelets = [0, 1, 2, 3].map((i) => ({ ...laneletOf({ id: i, types: ['country'],
    speed_limit: null, successors: i < 3 ? [i + 1] : [] }),
  left: [75 * i, 2, 75 * (i + 1), 2], right: [75 * i, -2, 75 * (i + 1), -2],
  center: [75 * i, 0, 75 * (i + 1), 0] }));
  assert.deepEqual([...stationsOf(lanelets).values()], [0, 75, 150, 225]);
  const { posts, lamps } = placed({ id: 'x', bounds: [0, -2, 300, 2], lanelets });
  assert.equal(lamps.length, 0);
  for (const side of [-2.5, 2.5]) {
    const row = posts.filter(({ y }) => Math.abs(y - side) < 1e-9).map(({ x }) => x);
    close(row.toSorted((a, b) => a - b), [0, 50, 100, 150, 200, 250], 1e-9);
  }
  assert.equal(posts.length, 12);
});

test('roads that lead in a circle have stations, too', () => {
  const ring = [0, 1].map((id) => laneletOf({ id, successors: [1 - id] }));
  assert.deepEqual([...stationsOf(ring)], [[0, 0], [1, 100]]);
});

test('equal seeds give equal places, other seeds other places', () => {
  const scene = winding();
  assert.deepEqual(placed(scene), placed(winding()));
  assert.notDeepEqual(placed(scene).trees, placed({ ...scene, id: 'other' }).trees);
});

test('fog: the contrast by Koschmieder is the product over thin layers of air', () => {
  for (const visibility of [40, 120, 1000]) {
    // 5 % at the visibility, by its definition; 3 stands for 2.996.
    close(contrastLeft(visibility, visibility), 0.05, 3e-4);
    const layers = 1e6;
    let left = 1;
    for (let i = 0; i < layers; i += 1) {
      left *= 1 - extinction(visibility) * 50 / layers;
    }
    close(contrastLeft(50, visibility), left, 1e-5);
  }
});

test('limits are written as on signs', () => {
  const told = ['13.89', '13.888888888888889', '8.33', '27.7778', '11.176', '16.666666666666668'];
  assert.deepEqual(told.map(speedText), ['50', '50', '30', '100', '40', '60']);
  assert.deepEqual([speedText(''), speedText('30 zone'), speedText('Infinity'), speedText('4')],
    ['', '30 z', 'Infi', '14']);
});

test('plates by kind: outline, paint and words', () => {
  const look = (kind, value = '', country = 'DEU') => {
    const { shape, style, symbol, text } = faceOf(kind, value, country);
    return [shape, style, symbol, text];
  };
  assert.deepEqual(look('MAX_SPEED', '13.89'), ['circle', 'prohibit', '', '50']);
  assert.deepEqual(look('MAX_SPEED', '13.89', 'USA'), ['tall', 'white', 'limit', '50']);
  assert.deepEqual(look('STOP'), ['octagon', 'stop', '', 'STOP']);
  assert.deepEqual(look('YIELD').slice(0, 2), ['yield', 'yield']);
  assert.deepEqual(look('PRIORITY').slice(0, 2), ['diamond', 'priority']);
  assert.deepEqual(look('WARNING_RIGHT_BEFORE_LEFT'), ['triangle', 'warn', 'cross', '']);
  assert.deepEqual(look('WARNING_STEEP_HILL_DOWNWARDS'), ['triangle', 'warn', 'danger', '']);
  // A sign without a drawing, or an unknown one, is a plate with its name.
  assert.deepEqual(look('GUIDE_SIGN_TABLE'), ['wide', 'white', '', 'Guide sign table']);
  assert.deepEqual(look('constructor', 'x'), ['wide', 'white', '', 'Constructor x']);
  assert.ok(look('X'.repeat(500))[3].length < 60);
});

const sign = (more) => ({ id: 1, x: 0, y: 0, yaw: 0, lanelets: [1], kind: 'MAX_SPEED',
  value: '13.89', virtual: false, ...more });

test('signs stand to the right of the road that they are for', () => {
  const lanelets = [laneletOf({ id: 1 })];
  const index = new RoadIndex(lanelets);
  const [pole] = placeSigns({ signs: [sign({ x: 50, y: 1 })], lanelets }, index);
  assert.deepEqual([pole.x, pole.yaw, pole.hangs], [50, 0, false]);
  // The edge is at -2, and 0.45 m are free around the pole.
  assert.ok(pole.y <= -2.45 && pole.y > -3, `${pole.y}`);
  const [there] = placeSigns({ signs: [sign({ x: 50, y: -6 })], lanelets }, index);
  assert.deepEqual([there.x, there.y], [50, -6]);
  const wide = [laneletOf({ id: 1, width: 60 })];
  const [above] = placeSigns({ signs: [sign({ x: 50 })], lanelets: wide }, new RoadIndex(wide));
  assert.ok(above.hangs);
});

test('a limit of each lanelet is put up once, where it begins', () => {
  const lanelets = [0, 1, 2].map((i) => laneletOf({ id: i, left: [100 * i, 2, 100 * i + 100, 2],
    right: [100 * i, -2, 100 * i + 100, -2], successors: i < 2 ? [i + 1] : [] }));
  const index = new RoadIndex(lanelets);
  const virtual = (values) => values.map((value, i) => sign({ id: i, x: 100 * i, y: -2,
    lanelets: [i], value, virtual: true }));
  const xs = (signs) => placeSigns({ signs, lanelets }, index).map(({ x }) => x);
  assert.deepEqual(xs(virtual(['13.89', '13.89', '13.89'])), [0]);
  assert.deepEqual(xs(virtual(['13.89', '8.33', '8.33'])), [0, 100]);
  // All signs of the map are put up.
  assert.deepEqual(xs(virtual(['13.89', '13.89', '13.89']).map(
    (one) => ({ ...one, virtual: false }))), [0, 100, 200]);
});

test('two plates of a sign share a pole, two lights at a place stand side by side', () => {
  const lanelets = [laneletOf({ id: 1 })];
  const index = new RoadIndex(lanelets);
  const [pole] = placeSigns({ signs: [sign({ y: -5 }), sign({ y: -5, kind: 'STOP', value: '' })],
    lanelets }, index);
  assert.deepEqual(pole.plates.map(({ kind }) => kind), ['MAX_SPEED', 'STOP']);
  const light = { id: 5, x: 100, y: -4, yaw: 0, direction: 'left', lanelets: [1] };
  const lights = placeLights({ lights: [light, { ...light, id: 6 }, { ...light, id: 7 }] }, index);
  close(lights.map(({ y }) => y), [-4, -4.7, -5.4], 1e-9);
});

test('obstacles: blocks hold every occupied cell once, and no free one', () => {
  const [rows, columns] = [37, 53];
  const occupied = Array.from({ length: rows * columns },
    (_, i) => (Math.floor(i / columns) * 7 + (i % columns) ** 2) % 5 < 3);
  const bits = new Uint8Array(Math.ceil(rows * columns / 8));
  occupied.forEach((is, i) => { bits[i >> 3] |= Number(is) << (i & 7); });
  const covered = new Array(rows * columns).fill(0);
  for (const block of blocksOf({ rows, columns, bits })) {
    for (let row = block.row; row < block.row + block.rows; row += 1) {
      for (let c = block.column; c < block.column + block.columns; c += 1) {
        covered[row * columns + c] += 1;
      }
    }
  }
  assert.deepEqual(covered, occupied.map(Number));
  const wall = new Uint8Array(8).fill(255);
  assert.equal(blocksOf({ rows: 8, columns: 8, bits: wall }).length, 1);
});

test('heights: between the bounds, on top of bridges, flat where the map is', () => {
  const hill = { ...laneletOf({ id: 1 }), left_z: [10, 20], right_z: [11, 21] };
  close(heightOn(hill, 50, 0), 15.5, 1e-9);
  close(heightOn(hill, 25, 2), 12.5, 1e-9);
  const bridge = { ...laneletOf({ id: 2, left: [48, -50, 48, 50], right: [52, -50, 52, 50] }),
    left_z: [25, 25], right_z: [25, 25] };
  const index = new RoadIndex([hill, bridge]);
  close([index.heightAt(50, 0), index.heightAt(25, 0), index.heightAt(50, 40)], [25, 13, 25],
    1e-9);
  // Beside a road the height of the nearest one, far from all roads 0.
  close([index.heightAt(10, 10), index.heightAt(500, 500)], [11, 0], 0.5);
  assert.equal(new RoadIndex([laneletOf()]).heightAt(50, 0), 0);
});
