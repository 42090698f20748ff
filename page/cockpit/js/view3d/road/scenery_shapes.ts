// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Roadside objects and their shapes; trees and houses have unit size. */

import { geometryOf } from './materials.js';
import { MeshParts } from './mesh_parts.js';
import { NearInstances } from './near_instances.js';

import type { Material } from 'three';
import type { Origin } from '../local_origin.js';
import type { Sight } from '../seen_instances.js';
import type { Three } from '../three.js';
import type { Heights, Rgb } from './mesh_parts.js';
import type { Roadside } from './roadside.js';

const COLOR: Record<string, Rgb> = {
  white: [238, 238, 234], black: [36, 36, 38], reflector: [236, 236, 255], steel: [128, 132, 136],
  lamp: [226, 224, 210], bark: [92, 74, 58], leaves: [255, 255, 255], wall: [255, 255, 255],
  roof: [120, 66, 54], window: [70, 84, 98],
};
// Corners of round parts.
const ROUND = 7;
// Corners of round parts that are small in the picture.
const PLAIN_ROUND = 6;

const shapeParts = () => new MeshParts({ x: 0, y: 0 });

/**
 * Add a body of revolution around the vertical: a trunk, a cone, a ball of a few rings.
 * @param profile from below
 * @param round how many corners it has
 */
export function addRound(parts: MeshParts, profile: [radius: number, height: number][], color: Rgb,
  round = ROUND) {
  const first = parts.ranks.length;
  profile.forEach(([radius, z], level) => {
    const [r0, z0] = profile[Math.max(level - 1, 0)];
    const [r1, z1] = profile[Math.min(level + 1, profile.length - 1)];
    const slope = Math.hypot(z1 - z0, r0 - r1) || 1;
    for (let k = 0; k < round; k += 1) {
      const angle = 2 * Math.PI * k / round;
      const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
      const shade = color.map(
        (value) => value * (0.72 + 0.28 * (level / Math.max(profile.length - 1, 1)))) as Rgb;
      parts.vertex(radius * cos, radius * sin, z, shade, 0,
        [cos * (z1 - z0) / slope, sin * (z1 - z0) / slope, (r0 - r1) / slope]);
      if (level > 0) {
        const here = first + level * round + k;
        const next = first + level * round + (k + 1) % round;
        parts.indices.push(here - round, next - round, next, here - round, next, here);
      }
    }
  });
}

/** Add a box's sides and top. */
export function addBox(parts: MeshParts, [x0, y0, z0]: [x: number, y: number, z: number],
  [x1, y1, z1]: [x: number, y: number, z: number], color: Rgb) {
  parts.addWall([x0, y0, x1, y0, x1, y1, x0, y1, x0, y0], () => z0, () => z1, color);
  parts.addFaces([x0, y0, x1, y0, x1, y1, x0, y1], [0, 1, 2, 0, 2, 3], () => z1, color, 0);
}

/** A delineator (sign 620), 1 m above the road. */
function post() {
  const parts = shapeParts();
  addBox(parts, [-0.06, -0.05, -0.3], [0.06, 0.05, 0.68], COLOR.white);
  addBox(parts, [-0.061, -0.051, 0.68], [0.061, 0.051, 0.92], COLOR.black);
  addBox(parts, [-0.025, -0.054, 0.71], [0.025, 0.054, 0.89], COLOR.reflector);
  addBox(parts, [-0.06, -0.05, 0.92], [0.06, 0.05, 1.0], COLOR.white);
  return parts;
}

/** A delineator of few triangles. */
function plainPost() {
  const parts = shapeParts();
  addBox(parts, [-0.06, -0.05, -0.3], [0.06, 0.05, 1.0], COLOR.white);
  addBox(parts, [-0.061, -0.051, 0.68], [0.061, 0.051, 0.92], COLOR.black);
  return parts;
}

/** A street lamp, whose arm reaches back over the road. */
function lamp() {
  const parts = shapeParts();
  addRound(parts, [[0.09, -0.3], [0.06, 6.4]], COLOR.steel);
  addBox(parts, [-1.5, -0.04, 6.3], [0, 0.04, 6.4], COLOR.steel);
  addBox(parts, [-1.7, -0.13, 6.24], [-1.0, 0.13, 6.34], COLOR.lamp);
  return parts;
}

/** A tree, whose crown begins above the eyes of car drivers. */
function tree() {
  const parts = shapeParts();
  addRound(parts, [[0.05, -0.05], [0.035, 0.45]], COLOR.bark);
  addRound(parts, [[0.16, 0.36], [0.42, 0.45], [0.5, 0.62], [0.4, 0.84], [0.2, 0.96], [0.02, 1]],
    COLOR.leaves);
  return parts;
}

function fir() {
  const parts = shapeParts();
  addRound(parts, [[0.05, -0.05], [0.04, 0.25]], COLOR.bark);
  addRound(parts, [[0.42, 0.2], [0.24, 0.5], [0.28, 0.5], [0.14, 0.76], [0.17, 0.76], [0.01, 1]],
    COLOR.leaves);
  return parts;
}

/** A tree of few triangles, of the same outline. */
function plainTree() {
  const parts = shapeParts();
  addRound(parts, [[0.045, -0.05], [0.035, 0.4]], COLOR.bark, 3);
  addRound(parts, [[0.16, 0.36], [0.5, 0.57], [0.43, 0.8], [0.08, 0.99]], COLOR.leaves,
    PLAIN_ROUND);
  return parts;
}

/** A fir of few triangles, of the same outline. */
function plainFir() {
  const parts = shapeParts();
  addRound(parts, [[0.045, -0.05], [0.04, 0.22]], COLOR.bark, 3);
  addRound(parts, [[0.4, 0.2], [0.01, 1]], COLOR.leaves, PLAIN_ROUND);
  return parts;
}

/** A house with a ridge along the road, and windows towards it. */
function house() {
  const parts = shapeParts();
  const [eaves, ridge] = [0.68, 1];
  addBox(parts, [-0.5, -0.5, -0.1], [0.5, 0.5, eaves], COLOR.wall);
  for (const z of [0.12, 0.42]) {
    for (const y of [-0.34, -0.02, 0.3]) {
      parts.addWall([-0.505, y + 0.1, -0.505, y - 0.04], () => z, () => z + 0.16, COLOR.window);
    }
  }
  const slope = 1 / Math.hypot(0.55, ridge - eaves);
  for (const side of [-1, 1]) {
    const normal: [number, number, number] = [side * slope * (ridge - eaves), 0, slope * 0.55];
    const first = parts.vertex(side * 0.55, -0.53, eaves - 0.02, COLOR.roof, 0, normal);
    parts.vertex(side * 0.55, 0.53, eaves - 0.02, COLOR.roof, 0, normal);
    parts.vertex(0, 0.53, ridge, COLOR.roof, 0, normal);
    parts.vertex(0, -0.53, ridge, COLOR.roof, 0, normal);
    parts.indices.push(...(side > 0 ? [0, 1, 2, 0, 2, 3] : [0, 2, 1, 0, 3, 2]).map(
      (corner) => first + corner));
    const gable = parts.vertex(-0.5, side * 0.5, eaves, COLOR.wall, 0, [0, side, 0]);
    parts.vertex(0.5, side * 0.5, eaves, COLOR.wall, 0, [0, side, 0]);
    parts.vertex(0, side * 0.5, ridge - 0.02, COLOR.wall, 0, [0, side, 0]);
    parts.indices.push(...(side > 0 ? [0, 2, 1] : [0, 1, 2]).map((corner) => gable + corner));
  }
  return parts;
}

const LEAVES = [0x5f7f3c, 0x6f8f48, 0x4f7236, 0x7c9150];
const NEEDLES = [0x3d5f3c, 0x48693f, 0x365438];
const WALLS = [0xe6ddc9, 0xd9d3c6, 0xe9e4dc, 0xd8c3a2, 0xc9b49a, 0xdfe3e2];
const NEAREST = { posts: [240, 700], lamps: [200, 500], trees: [420, 650], firs: [320, 650],
  houses: [220, 800] };

/** The instances of all roadside objects. */
export class Scenery {
  #kinds: NearInstances[] = [];

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
