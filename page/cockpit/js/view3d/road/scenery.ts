// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Roadside objects: posts, lamps, trees and houses; of each kind, the near ones are drawn. */

import { geometryOf } from './materials.js';
import { NearInstances } from './near_instances.js';
import { fir, house, lamp, plainFir, plainPost, plainTree, post, tree } from './scenery_shapes.js';

import type { Origin } from '../local_origin.js';
import type { Heights } from './mesh_parts.js';
import type { Material } from 'three';
import type { Roadside } from './roadside.js';
import type { Sight } from '../seen_instances.js';
import type { Three } from '../three.js';

const LEAVES = [0x5f7f3c, 0x6f8f48, 0x4f7236, 0x7c9150];
const NEEDLES = [0x3d5f3c, 0x48693f, 0x365438];
const WALLS = [0xe6ddc9, 0xd9d3c6, 0xe9e4dc, 0xd8c3a2, 0xc9b49a, 0xdfe3e2];
const NEAREST = { posts: [240, 700], lamps: [200, 500], trees: [420, 650], firs: [320, 650],
  houses: [220, 800] };

/** The instances of all roadside objects. */
export class Scenery {
  #kinds: NearInstances[] = [];

  /** @param three the library */
  constructor(three: Three, roadside: Roadside, origin: Origin, heights: Heights,
    painted: Material) {
    const shapes = { posts: post(), lamps: lamp(), trees: tree(), firs: fir(), houses: house() };
    const plain = { trees: plainTree(), firs: plainFir(), posts: plainPost(),
      lamps: lamp(), houses: house() };
    const tones = { posts: [0xffffff], lamps: [0xffffff], trees: LEAVES, firs: NEEDLES,
      houses: WALLS };
    for (const kind of Object.keys(shapes) as (keyof Roadside)[]) {
      const instances = roadside[kind].map(({ x, y, yaw, size, shade }) => ({
        x: x - origin.x, y: y - origin.y, z: heights(x, y), yaw, size,
        color: tones[kind][Math.floor(shade * tones[kind].length)] }));
      if (instances.length > 0) {
        const [most, reach] = NEAREST[kind];
        this.#kinds.push(new NearInstances(three, geometryOf(three, shapes[kind]),
          painted, instances, most, reach, geometryOf(three, plain[kind])));
      }
    }
  }

  get meshes() {
    return this.#kinds.flatMap(({ meshes }) => meshes);
  }

  get triangles() {
    return this.#kinds.reduce((sum, { triangles }) => sum + triangles, 0);
  }

  update(eye: { x: number; y: number }) {
    this.#kinds.forEach((kind) => kind.update(eye));
  }

  /** @param sight of the camera that draws next */
  see(sight: Sight) {
    this.#kinds.forEach((kind) => kind.see(sight));
  }

  /** Free the memory of the graphics card. */
  dispose() {
    this.#kinds.forEach((kind) => kind.dispose());
  }
}
