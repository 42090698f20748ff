// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Instances of one mesh, whose painted triangles have a colour for each instance. */

import { SeenInstances } from './seen_instances.js';

import type { BufferGeometry, Group, Material, Matrix4 } from 'three';
import type { MeshBuilder } from './bodies/mesh_builder.js';
import type { Three } from './three.js';
import type { Part, Sight } from './seen_instances.js';

const WHITE = 0xffffff;

/** Instances that are added anew in each frame. */
export class Instances {
  #color;
  #material;
  #seen;

  /**
   * @param group gets the meshes
   * @param most how many there can be
   * @param plain mesh of instances far away; null: the same
   * @param sooner see Shapes
   */
  constructor(three: Three, group: Group, mesh: MeshBuilder, most: number,
    plain: MeshBuilder | null = null, sooner = 1) {
    this.#color = new three.Color();
    this.#material = new three.MeshLambertMaterial({ color: WHITE, vertexColors: true });
    this.#seen = new SeenInstances(three, { near: partsOf(three, mesh, this.#material),
      far: plain === null ? [] : partsOf(three, plain, this.#material), sooner }, most);
    group.add(...this.#seen.meshes);
  }

  /** Begin a frame. */
  clear() {
    this.#seen.clear();
  }

  /** @param isOwn whether it is of the vehicle in which the camera may be */
  add(matrix: Matrix4, color: number, isOwn: boolean) {
    this.#seen.add(matrix, this.#color.setHex(color), isOwn);
  }

  /** @param sight of the camera that draws next */
  see(sight: Sight) {
    this.#seen.see(sight);
  }

  /** Free the memory of the graphics card. */
  dispose() {
    this.#seen.dispose();
    this.#material.dispose();
  }
}

function partsOf(three: Three, mesh: MeshBuilder, material: Material): Part[] {
  return [true, false].map((tinted) => (
    { geometry: geometryOf(three, mesh.arrays(tinted)), material, tinted }))
    .filter(({ geometry }) => geometry.getAttribute('position').count > 0);
}

export function geometryOf(three: Three,
  { positions, normals, colors }: ReturnType<MeshBuilder['arrays']>): BufferGeometry {
  const geometry = new three.BufferGeometry();
  geometry.setAttribute('position', new three.BufferAttribute(positions, 3));
  geometry.setAttribute('normal', new three.BufferAttribute(normals, 3));
  geometry.setAttribute('color', new three.BufferAttribute(colors, 3));
  return geometry;
}
