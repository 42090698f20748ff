// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Many things of one shape, drawn by one call each for what is painted and what is not. */

/** @import { BufferGeometry, Group, InstancedMesh, Matrix4 } from 'three' */
/** @import { MeshBuilder } from './bodies/mesh_builder.js' */
/** @import { Three } from './road/road_world.js' */

const WHITE = 0xffffff;

/** Instances are put in anew in each frame, those of the own vehicle last. */
export class Instances {
  /** @type {InstancedMesh[]} */
  #meshes;
  #color;
  #count = 0;
  #shared = 0;

  /**
   * @param {Three} three
   * @param {Group} group gets the meshes
   * @param {MeshBuilder} mesh
   * @param {number} most how many there can be
   */
  constructor(three, group, mesh, most) {
    this.#color = new three.Color();
    const material = new three.MeshLambertMaterial({ color: WHITE, vertexColors: true });
    this.#meshes = [true, false].map((painted) => {
      const instances = new three.InstancedMesh(
        geometryOf(three, mesh.arrays(painted)), material, most);
      // Their places are known to nobody but the matrices.
      instances.frustumCulled = false;
      instances.count = 0;
      return instances;
    }).filter(({ geometry }) => geometry.getAttribute('position').count > 0);
    this.#meshes.forEach((instances) => {
      instances.instanceMatrix = this.#meshes[0].instanceMatrix;
      instances.instanceMatrix.setUsage(three.DynamicDrawUsage);
    });
    // Set at once: the program of a mesh is made for instances with colours or without.
    this.#meshes[0].setColorAt(0, this.#color);
    group.add(...this.#meshes);
    this.triangles = mesh.triangles;
  }

  /** Begin a frame. */
  clear() {
    this.#count = 0;
    this.#shared = 0;
  }

  /**
   * @param {Matrix4} matrix
   * @param {number} color
   * @param {boolean} isOwn whether it is of the vehicle in which the camera may be
   */
  add(matrix, color, isOwn) {
    const [first] = this.#meshes;
    first.setMatrixAt(this.#count, matrix);
    first.setColorAt(this.#count, this.#color.setHex(color));
    this.#count += 1;
    this.#shared += isOwn ? 0 : 1;
  }

  /** End a frame: what was added is shown. */
  commit() {
    for (const mesh of this.#meshes) {
      mesh.count = this.#count;
    }
    this.#meshes[0].instanceMatrix.needsUpdate = true;
    const colors = this.#meshes[0].instanceColor;
    if (colors !== null) {
      colors.needsUpdate = true;
    }
  }

  /** @param {boolean} shown whether what was added as own is drawn */
  showOwn(shown) {
    for (const mesh of this.#meshes) {
      mesh.count = shown ? this.#count : this.#shared;
    }
  }

  /** How many are there. */
  get count() {
    return this.#count;
  }

  /** Free what the graphics card holds. */
  dispose() {
    for (const mesh of this.#meshes) {
      mesh.removeFromParent();
      mesh.geometry.dispose();
      mesh.dispose();
      /** @type {import('three').Material} */ (mesh.material).dispose();
    }
  }
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
