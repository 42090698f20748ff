// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Which plans of AVs are drawn, on the map and as ribbons in 3D. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { liveStore, openPage } from './dom_support.mjs';
import { PlanRibbons } from '../../page/cockpit/js/view3d/plan_ribbons.js';
import { PlanLayer, shownPlans } from '../../page/cockpit/js/world/plan_layer.js';

const HIDE = { name: 'a', kind: 'plan_display', av: 'av0', show: false };
const EVENTS = [HIDE, { ...HIDE, name: 'b', show: true }, { name: 'c', kind: 'release' }];
const SHOWN = { t: 0, vehicles: new Float64Array(26) };
// Of two poses: a ribbon of them has two triangles.
const POINTS = Float64Array.of(0, 0, 0, 8, 0, 8, 0, 0, 8, 1);

openPage();

/** Return a store with plans of av0 and av1, after some events. */
function storeAfter(...fired) {
  const store = liveStore([{ id: 'av0' }, { id: 'av1' }], { events: EVENTS });
  store.receive({ type: 'events', fired: fired.map((name) => ({ name })) });
  [0, 1].forEach((index) => store.plans.set(index, { index, t: 0, points: POINTS }));
  return store;
}

/** Stands for three.js: keeps the one mesh. */
function recordMesh() {
  const three = { made: null, DoubleSide: 2 };
  three.Mesh = class {
    geometry = new three.BufferGeometry();
  };
  three.MeshBasicMaterial = class {};
  three.BufferGeometry = class {
    positions = [];

    setAttribute(_, positions) {
      this.positions = positions;
    }

    dispose() {}
  };
  three.Float32BufferAttribute = class extends Array {
    constructor(values) {
      super();
      this.push(...values);
    }
  };
  return three;
}

/** Return the number of ribbons that are drawn. */
function ribbons(store, shown = SHOWN) {
  let mesh;
  const drawn = new PlanRibbons(recordMesh(), { add: (added) => { mesh = added; } }, store);
  drawn.update(true, shown, { x: 0, y: 0 }, () => 0);
  return mesh.visible ? mesh.geometry.positions.length / 18 : 0;
}

test('events of the game hide plans and show them again', () => {
  const after = (...names) => shownPlans(storeAfter(...names), SHOWN).map(({ index }) => index);
  assert.deepEqual([after(), after('a'), after('a', 'c'), after('a', 'b'), after('b', 'a')],
    [[0, 1], [1], [1], [0, 1], [1]]);
  const layer = new PlanLayer();
  layer.on = false;
  // It would need a context.
  layer.draw(null, { store: storeAfter(), shown: SHOWN }, []);
});

test('3D shows the same plans as the map, none of an absent AV', () => {
  assert.deepEqual([ribbons(storeAfter()), ribbons(storeAfter('a'))], [2, 1]);
  const absent = { ...SHOWN, vehicles: Float64Array.of(NaN, ...SHOWN.vehicles.slice(1)) };
  assert.equal(ribbons(storeAfter(), absent), 1);
});
