// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The AVs' newest plans as ribbons on the road, on request. */

import { PLAN_WIDTH } from '../frames.js';
import { themeColor } from '../world/palette.js';
import { shownPlans } from '../world/plan_layer.js';

import type { Group } from 'three';
import type { PlanFrame } from '../frames.js';
import type { Shown, Store } from '../store.js';
import type { Origin } from './local_origin.js';
import type { Three } from './three.js';
import type { HeightAt } from './traffic.js';

const HALF_WIDTH_M = 0.35;
const ABOVE_M = 0.08;
const OPACITY = 0.65;

/** One mesh for all plans. */
export class PlanRibbons {
  #three;
  #store;
  #mesh;

  constructor(three: Three, group: Group, store: Store) {
    this.#three = three;
    this.#store = store;
    this.#mesh = new three.Mesh(new three.BufferGeometry(), new three.MeshBasicMaterial({
      color: themeColor('av'), transparent: true, opacity: OPACITY, depthWrite: false,
      side: three.DoubleSide }));
    this.#mesh.frustumCulled = false;
    this.#mesh.visible = false;
    this.#mesh.renderOrder = 6;
    group.add(this.#mesh);
  }

  /** @param on whether plans are shown */
  update(on: boolean, shown: Shown, origin: Origin, heightAt: HeightAt) {
    this.#mesh.visible = on;
    if (!on) {
      return;
    }
    const positions: number[] = [];
    for (const plan of shownPlans(this.#store, shown)) {
      addRibbon(positions, plan, shown.t, origin, heightAt);
    }
    this.#mesh.visible = positions.length > 0;
    this.#mesh.geometry.dispose();
    this.#mesh.geometry = new this.#three.BufferGeometry();
    this.#mesh.geometry.setAttribute('position',
      new this.#three.Float32BufferAttribute(positions, 3));
  }
}

/** @param t simulation time that is shown; the past part of the plan is left out [s] */
function addRibbon(positions: number[], { points, t: start_t }: PlanFrame, t: number,
  origin: Origin, heightAt: HeightAt) {
  let before: number[][] | null = null;
  for (let row = 0; row < points.length; row += PLAN_WIDTH) {
    const [x, y, yaw, , after] = points.subarray(row, row + PLAN_WIDTH);
    if (start_t + after >= t) {
      const z = heightAt(x, y) + ABOVE_M;
      const edge = [1, -1].map((side) => [
        x - side * HALF_WIDTH_M * Math.sin(yaw) - origin.x,
        y + side * HALF_WIDTH_M * Math.cos(yaw) - origin.y, z]);
      if (before !== null) {
        positions.push(...before[0], ...before[1], ...edge[0], ...edge[0], ...before[1],
          ...edge[1]);
      }
      before = edge;
    }
  }
}
