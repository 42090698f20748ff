// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Instances of things that exist in hundreds: the nearest to the eye are drawn at once. */

import { SeenInstances } from '../seen_instances.js';

import type { BufferGeometry, Material } from 'three';
import type { Sight } from '../seen_instances.js';
import type { Three } from '../three.js';

const CELL_M = 100;
// How far the eye moves before the nearest are searched again [m].
const MOVED_M = 40;

/** From the local origin. */
export interface Instance {
  x: number;
  y: number;
  z: number; // of its foot [m]
  yaw: number; // [rad]
  size: [number, number, number]; // scale of its unit shape
  color: number; // as on the screen; multiplies the shape's own
}

/** Instances of one shape, drawn in one call, or in two if those far away are plainer. */
export class NearInstances {
  #cells = new Map<string, Instance[]>();
  #three;
  #reach;
  #most;
  #seen;
  #shape;
  #at = { x: Infinity, y: Infinity };

  /**
   * @param shape of which every instance is one
   * @param most number drawn at a time
   * @param reach within which they are drawn [m]
   * @param plain the shape of those far away; null: the same
   */
  constructor(three: Three, shape: BufferGeometry, material: Material, instances: Instance[],
    most: number, reach: number, plain: BufferGeometry | null = null) {
    this.#three = three;
    this.#reach = reach;
    this.#most = Math.min(most, instances.length);
    this.#shape = shape;
    this.#seen = new SeenInstances(three, { near: [{ geometry: shape, material, tinted: true }],
      far: plain === null ? [] : [{ geometry: plain, material, tinted: true }] }, this.#most);
    for (const instance of instances) {
      const key = `${Math.floor(instance.x / CELL_M)} ${Math.floor(instance.y / CELL_M)}`;
      const cell = this.#cells.get(key) ?? [];
      this.#cells.set(key, cell);
      cell.push(instance);
    }
  }

  get meshes() {
    return this.#seen.meshes;
  }

  /** Return the largest number of triangles. */
  get triangles() {
    const { index, attributes } = this.#shape;
    return this.#most * (index?.count ?? attributes.position.count) / 3;
  }

  /** Choose the instances around the eye. */
  update({ x, y }: { x: number; y: number }) {
    if (Math.hypot(x - this.#at.x, y - this.#at.y) < MOVED_M) {
      return;
    }
    this.#at = { x, y };
    const near = this.#near(x, y);
    const { Color, Matrix4, Quaternion, Vector3 } = this.#three;
    const [matrix, turn, up, color] = [new Matrix4(), new Quaternion(), new Vector3(0, 0, 1),
      new Color()];
    this.#seen.clear();
    near.forEach((instance) => {
      turn.setFromAxisAngle(up, instance.yaw);
      matrix.compose(new Vector3(instance.x, instance.y, instance.z), turn,
        new Vector3(...instance.size));
      this.#seen.add(matrix, color.set(instance.color), false);
    });
    this.#seen.see(null);
  }

  /** @param sight of the camera that draws next */
  see(sight: Sight) {
    this.#seen.see(sight);
  }

  /** @returns the nearest ones */
  #near(x: number, y: number): Instance[] {
    const found = [];
    const cells = Math.ceil(this.#reach / CELL_M);
    const [column, row] = [Math.floor(x / CELL_M), Math.floor(y / CELL_M)];
    for (let c = column - cells; c <= column + cells; c += 1) {
      for (let r = row - cells; r <= row + cells; r += 1) {
        for (const instance of this.#cells.get(`${c} ${r}`) ?? []) {
          const distance = Math.hypot(instance.x - x, instance.y - y);
          if (distance < this.#reach) {
            found.push({ instance, distance });
          }
        }
      }
    }
    return found.sort((a, b) => a.distance - b.distance).slice(0, this.#most)
      .map(({ instance }) => instance);
  }

  /** Free the memory of the graphics card, except the material. */
  dispose() {
    this.#seen.dispose();
  }
}
