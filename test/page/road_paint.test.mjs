// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Roads of the 3D view: width and length of their surfaces and markings. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { close, laneletOf } from './support.mjs';

const JS = '../../page/cockpit/js';
const { collectBoundaries } = await import(`${JS}/world/boundaries.js`);
const { roadClass, strokesOf } = await import(`${JS}/world/marking_strokes.js`);
const { MeshParts } = await import(`${JS}/view3d/road/mesh_parts.js`);
const { buildRoads, ladder } = await import(`${JS}/view3d/road/road_chunks.js`);
const { RoadIndex } = await import(`${JS}/view3d/road/road_index.js`);
const { COLOR, RANK, RoadPaint } = await import(`${JS}/view3d/road/road_paint.js`);
const { paintedPieces, stripOf } = await import(`${JS}/view3d/road/strips.js`);
const { buildLand } = await import(`${JS}/view3d/road/land.js`);

const FLAT = () => 0;
const MOTORWAY = { types: ['interstate'], speed_limit: null };
const COUNTRY = { types: ['country'], speed_limit: 27.78 / 1.2 };

/** A quarter of a circle around the origin, from the x axis to the y axis. */
const arc = (radius, steps = 40) => Array.from({ length: steps + 1 }, (_, i) => i).flatMap(
  (i) => [radius * Math.cos(Math.PI / 2 * i / steps), radius * Math.sin(Math.PI / 2 * i / steps)]);

const lengthOf = (line) => {
  let length = 0;
  for (let i = 2; i < line.length; i += 2) {
    length += Math.hypot(line[i] - line[i - 2], line[i + 1] - line[i - 1]);
  }
  return length;
};

/** Return the paint of one lanelet's left bound, without a marking on its right one. */
function painted(marking, more = {}, country = 'DEU') {
  const lanelet = laneletOf({ left_line: marking, right_line: 'no_marking', ...more });
  const parts = new MeshParts({ x: 0, y: 0 });
  const paint = new RoadPaint({ country }, new RoadIndex([lanelet]), FLAT);
  for (const boundary of collectBoundaries([lanelet])) {
    paint.addBoundary(parts, boundary, lanelet);
  }
  return parts;
}

/** Return the area of all triangles, seen from above. */
function areaOf({ positions, indices }) {
  let area = 0;
  for (let i = 0; i < indices.length; i += 3) {
    const [a, b, c] = indices.slice(i, i + 3).map((index) => 3 * index);
    area += 0.5 * ((positions[b] - positions[a]) * (positions[c + 1] - positions[a + 1])
      - (positions[b + 1] - positions[a + 1]) * (positions[c] - positions[a]));
  }
  return area;
}

test('the guideline: dashes and widths of motorways, country roads and towns', () => {
  const layout = (marking, road) => {
    const [{ width, dash }] = strokesOf({ marking, inner: false }, laneletOf(road));
    return [width, ...dash ?? []];
  };
  assert.deepEqual([MOTORWAY, COUNTRY, {}].map((road) => layout('dashed', road)),
    [[0.15, 6, 12], [0.12, 4, 8], [0.12, 3, 6]]);
  assert.deepEqual([MOTORWAY, COUNTRY, {}].map((road) => layout('broad_dashed', road)),
    [[0.3, 6, 6], [0.25, 3, 3], [0.25, 3, 3]]);
  assert.deepEqual(['solid', 'broad_solid'].map((marking) => layout(marking, MOTORWAY)),
    [[0.15], [0.3]]);
});

test('the kind of road: by types, then by the limit', () => {
  const kmh = (types, speed) => roadClass({ types, speed_limit: speed === null ? null
    : speed / 3.6 });
  assert.deepEqual([kmh(['highway'], 50), kmh(['urban'], null), kmh(['urban'], 50),
    kmh(['urban'], 70), kmh(['urban'], 100), kmh(['unknown'], null), kmh(['unknown'], 30)],
  ['motorway', 'town', 'town', 'country', 'motorway', 'country', 'town']);
});

test('number and paint of dashes agree with the closed form', () => {
  for (const [length, dash, gap] of [[100, 3, 6], [99, 3, 6], [18, 6, 12], [7.5, 4, 8]]) {
    const pieces = paintedPieces([0, 0, length, 0], [dash, gap]);
    const whole = Math.floor(length / (dash + gap));
    const rest = Math.min(length - whole * (dash + gap), dash);
    assert.equal(pieces.length, whole + (rest > 1e-9 ? 1 : 0));
    close(pieces.reduce((sum, piece) => sum + lengthOf(piece), 0), whole * dash + rest, 1e-9);
  }
});

test('around a bend dashes keep their length along the line', () => {
  const line = arc(50, 200);
  const pieces = paintedPieces(line, [3, 6]);
  pieces.slice(0, -1).forEach((piece) => close(lengthOf(piece), 3, 1e-9));
  // The arc is 78.54 m long, the polyline 0.2 mm less: nine periods of 9 m begin in it.
  assert.equal(pieces.length, 9);
});

test('a strip has its width, also in bends', () => {
  const [left, right] = stripOf(arc(30, 60), 0.3);
  for (let i = 0; i < left.length; i += 2) {
    close([Math.hypot(left[i], left[i + 1]), Math.hypot(right[i], right[i + 1])],
      [29.85, 30.15], 1e-4);
  }
});

test('the paint of each marking: length times width', () => {
  // 100 m in a town: twelve dashes, the last of 1 m; seventeen blocks, the last of 3 m.
  close(areaOf(painted('solid')), 100 * 0.12, 1e-9);
  close(areaOf(painted('dashed')), 34 * 0.12, 1e-9);
  close(areaOf(painted('broad_solid')), 100 * 0.25, 1e-9);
  close(areaOf(painted('broad_dashed')), 51 * 0.25, 1e-9);
  close(areaOf(painted('solid_dashed')), 134 * 0.12, 1e-9);
  close(areaOf(painted('dashed', MOTORWAY)), 36 * 0.15, 1e-9);
  assert.equal(painted('no_marking').triangles, 0);
});

test('an unknown marking is a worn line, but not at a crossing', () => {
  const worn = painted('unknown');
  close(areaOf(worn), 100 * 0.12, 1e-9);
  assert.deepEqual(worn.colors.slice(0, 3), COLOR.worn);
  assert.equal(painted('unknown', { intersection: true }).triangles, 0);
});

test('kerbs stand above the road, lowered ones less', () => {
  const heights = (marking) => {
    const { positions } = painted(marking);
    const z = positions.filter((_, i) => i % 3 === 2);
    return [Math.min(...z), Math.max(...z)];
  };
  assert.deepEqual([heights('curb'), heights('lowered_curb')], [[0, 0.12], [0, 0.03]]);
});

test('no kerb leads across another lane', () => {
  const own = laneletOf({ left_line: 'curb', right_line: 'no_marking' });
  const across = laneletOf({ id: 2, left: [40, -20, 40, 20], right: [60, -20, 60, 20],
    center: [50, -20, 50, 20] });
  const parts = new MeshParts({ x: 0, y: 0 });
  const [kerb] = collectBoundaries([own]);
  new RoadPaint({ country: 'DEU' }, new RoadIndex([own, across]), FLAT).addBoundary(parts, kerb,
    own);
  const xs = parts.positions.filter((_, i) => i % 3 === 0);
  assert.ok(xs.some((x) => x < 39) && xs.some((x) => x > 61));
  assert.ok(!xs.some((x) => x > 40.5 && x < 59.5));
});

test('centre lines are yellow in countries with yellow ones', () => {
  const color = (country) => painted('solid', { adj_left: 7, adj_left_same: false }, country)
    .colors.slice(0, 3);
  assert.deepEqual([color('DEU'), color('USA')], [COLOR.white, COLOR.yellow]);
});

test('between bounds with heights the triangles fill the lanelet', () => {
  const lanelet = { left: arc(40, 17), right: arc(44, 31) };
  const ring = [...lanelet.left];
  for (let i = lanelet.right.length - 2; i >= 0; i -= 2) {
    ring.push(lanelet.right[i], lanelet.right[i + 1]);
  }
  const parts = new MeshParts({ x: 0, y: 0 });
  parts.addFaces(ring, ladder(lanelet), FLAT, COLOR.road, RANK.road);
  let doubled = 0;
  for (let i = 0, j = ring.length - 2; i < ring.length; j = i, i += 2) {
    doubled += ring[j] * ring[i + 1] - ring[i] * ring[j + 1];
  }
  close(areaOf(parts), Math.abs(doubled) / 2, 1e-9);
  assert.equal(parts.triangles, 18 + 32 - 2);
});

test('far from the origin float32 is precise enough', () => {
  const [x, y] = [691_000, 5_337_000];
  const parts = new MeshParts({ x, y });
  parts.addStrip([x + 0.1, y + 0.06, x + 10, y + 0.06], [x + 0.1, y - 0.06, x + 10, y - 0.06],
    FLAT, COLOR.white, RANK.line);
  close(Array.from(new Float32Array(parts.positions)), parts.positions, 1e-6);
  close(areaOf(parts), 9.9 * 0.12, 1e-8);
});

/** A grid of 10 streets each way, every one of 20 lanelets: 400. */
function town() {
  const lanelets = [];
  for (let street = 0; street < 10; street += 1) {
    for (let part = 0; part < 20; part += 1) {
      for (const turned of [false, true]) {
        const along = (s, d) => (turned ? [100 * street + d, 50 * part + s]
          : [50 * part + s, 100 * street + d]);
        const line = (d) => Array.from({ length: 26 }, (_, i) => along(2 * i, d)).flat();
        lanelets.push({ ...laneletOf({ id: lanelets.length, left: line(1.75),
          right: line(-1.75), center: line(0), left_line: 'dashed', right_line: 'curb' }) });
      }
    }
  }
  return { id: 'town', country: 'DEU', bounds: [0, 0, 1000, 1000], lanelets, gaps: [],
    stop_lines: [{ points: [0, -2, 0, 2], lanelet: 0, line: 'solid' }] };
}

test('400 lanelets take few meshes and few triangles', () => {
  const scene = town();
  assert.equal(scene.lanelets.length, 400);
  const index = new RoadIndex(scene.lanelets);
  // A polygon of n points has n - 2 triangles in any triangulation.
  const triangulate = (ring) => new Array(3 * (ring.length / 2 - 2)).fill(0);
  const roads = buildRoads(scene, { x: 500, y: 500 }, index, FLAT, triangulate);
  const land = buildLand(scene, { x: 500, y: 500 }).tiles;
  // With two skies, five kinds beside the road, near and far, signs, lights, obstacles: 18.
  assert.ok(roads.length + land.length + 18 <= 60, `${roads.length}, ${land.length} chunks`);
  const triangles = [...roads, ...land].reduce((sum, parts) => sum + parts.triangles, 0);
  // Trees and the like take 70,000 at most.
  assert.ok(triangles + 70_000 <= 150_000, `${triangles} triangles`);
});

test('tiles of the land have no gaps and do not overlap', () => {
  const { tiles } = buildLand(town(), { x: 500, y: 500 });
  const areas = tiles.flatMap(({ positions, indices }) => Array.from(
    { length: indices.length / 3 }, (_, i) => {
      const [[ax, ay], [bx, by], [cx, cy]] = [0, 1, 2].map(
        (k) => positions.slice(3 * indices[3 * i + k], 3 * indices[3 * i + k] + 2));
      return ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)) / 2;
    }));
  // Each is seen from above, and together they are the square around the map.
  assert.ok(areas.every((area) => area > 0));
  const xs = tiles.flatMap(({ positions }) => positions.filter((_, i) => i % 3 === 0));
  const edge = Math.max(...xs) - Math.min(...xs);
  assert.ok(edge >= 1000 + 2 * 1200);
  const sum = areas.reduce((total, area) => total + area, 0);
  assert.ok(Math.abs(sum / edge ** 2 - 1) < 1e-9, `${sum} of ${edge ** 2}`);
});
