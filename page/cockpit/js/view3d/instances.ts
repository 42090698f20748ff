// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Instances of one mesh, whose painted triangles have a colour for each instance. */

import { SeenInstances } from './seen_instances.js';

/** @import { BufferGeometry, Group, Material, Matrix4 } from 'three' */
/** @import { MeshBuilder } from './bodies/mesh_builder.js' */
/** @import { Three } from './road/road_world.js' */
/** @import { Part, Sight } from './seen_instances.js' */

const WHITE = 0xffffff;

/** Instances that are added anew in each frame. */
export class Instances {
  #color;
  #material;
  #seen;

  /**
   * @param {Three} three
   * @param {Group} group gets the meshes
   * @param {MeshBuilder} mesh
   * @param {number} most how many there can be
   * @param {MeshBuilder|null} [plain] mesh of instances far away; null: the same
   * @param {number} [sooner] see Shapes
   */
  constructor(three, group, mesh, most, plain = null, sooner = 1) {
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

  /**
   * @param {Matrix4} matrix
   * @param {number} color
   * @param {boolean} isOwn whether it is of the vehicle in which the camera may be
   */
  add(matrix, color, isOwn) {
    this.#seen.add(matrix, this.#color.setHex(color), isOwn);
  }

  /** @param {Sight} sight of the camera that draws next */
  see(sight) {
    this.#seen.see(sight);
  }

  /** Free the memory of the graphics card. */
  dispose() {
    this.#seen.dispose();
    this.#material.dispose();
  }
}

/**
 * @param {Three} three
 * @param {MeshBuilder} mesh
 * @param {Material} material
 * @returns {Part[]}
 */
function partsOf(three, mesh, material) {
  return [true, false].map((tinted) => (
    { geometry: geometryOf(three, mesh.arrays(tinted)), material, tinted }))
    .filter(({ geometry }) => geometry.getAttribute('position').count > 0);
}

/**
 * @param {Three} three
 * @param {ReturnType<MeshBuilder['arrays']>} arrays
 * @returns {BufferGeometry}
 */
export function geometryOf(three, { positions, normals, colors }) {
  const geometry = new three.BufferGeometry();
  geometry.setAttribute('position', new three.BufferAttribute(positions, 3));
  geometry.setAttribute('normal', new three.BufferAttribute(normals, 3));
  geometry.setAttribute('color', new three.BufferAttribute(colors, 3));
  return geometry;
}
