// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Small drawings on canvases: a scenario's preview, the masks of traffic lights' lamps. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { openPage } from './dom_support.mjs';
import { laneletOf } from './support.mjs';
import { ScenarioPreview } from '../../page/cockpit/js/panels/scenario_preview.js';
import { lampMasks } from '../../page/cockpit/js/view3d/road/traffic_lights.js';
import { colorNameOf } from '../../page/cockpit/js/world/palette.js';

openPage();
globalThis.getComputedStyle = ({ style }) => ({ color: style.color });
globalThis.ResizeObserver = class {
  observe() {}
};

/** Make a canvas that keeps its colour and its path at each `fill`, and ignores the rest. */
function recordFills() {
  const fills = [];
  let path = [];
  const calls = {
    beginPath: () => { path = []; },
    fill: () => fills.push({ color: drawing.fillStyle, path: [...path] }),
  };
  const drawing = new Proxy({}, {
    get: (set, name) => set[name] ?? calls[name] ?? (() => path.push(name)) });
  const canvas = Object.assign(document.createElement('canvas'), {
    getContext: () => drawing, getBoundingClientRect: () => ({ width: 400, height: 300 }) });
  return { canvas, fills };
}

test('people have the colour of their role, whatever they drive', () => {
  const named = (role, ...types) => types.map((type) => colorNameOf({ role, type }));
  assert.deepEqual(named('human', 'car', 'bicycle'), ['human', 'human']);
  assert.deepEqual(named('autonomous', 'car', 'bicycle'), ['av', 'av']);
  assert.deepEqual(named('traffic', 'car', 'motorcycle', 'bicycle', 'pedestrian'),
    ['traffic', 'traffic', 'vulnerable', 'vulnerable']);
  assert.deepEqual(named('recorded', 'car', 'bicycle'), ['recorded', 'vulnerable']);
});

test('a preview has the colours of the map', () => {
  const { canvas, fills } = recordFills();
  const shape = { kind: 'rectangle', length: 4, width: 2, vertices: [] };
  const objects = ['motorcycle', 'bicycle'].map((type) => ({ role: 'recorded', type, shape }));
  const vehicles = [{ role: 'human', type: 'bicycle', shape, rear_to_center: 0 }];
  new ScenarioPreview(canvas).show({
    scene: { bounds: [0, -5, 50, 5], lanelets: [laneletOf()], goals: [], objects, vehicles },
    states: { objects: [[1, 0, 0], [9, 0, 0]], vehicles: [[5, 0, 0]] } });
  assert.deepEqual(fills.map(({ color }) => color.slice('var(--'.length, -1)),
    ['map-road', 'recorded', 'vulnerable', 'human']);
});

test('the round lamp is a disc and nothing of the arrows before it', () => {
  const { canvas, fills } = recordFills();
  const { createElement } = document;
  document.createElement = () => canvas;
  lampMasks();
  document.createElement = createElement;
  assert.deepEqual(fills.at(-1).path.filter((name) => name !== 'save'), ['arc']);
});
