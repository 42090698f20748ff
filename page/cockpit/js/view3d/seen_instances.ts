// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Instances of one shape, of which a picture draws those visible to its camera. */

import { MergedMesh } from './merged_mesh.js';

/** @import { BufferGeometry, Camera, InstancedBufferAttribute, InstancedMesh } from 'three' */
/** @import { Color, Material, Matrix4, Mesh } from 'three' */
/** @typedef {typeof import('./three.js')} Three */

/**
 * The sight of a camera: instances out of sight are not submitted to the renderer, and those that
 * are small in the picture have fewer triangles.
 *
 * @typedef {object} Sight
 * @property {Float64Array} planes six of them, four numbers each: a point within has
 *   a x + b y + c z + d >= 0, from the local origin
 * @property {{x: number, y: number}} eye from the local origin [m]
 * @property {number} plain_m beyond it the plain shape is drawn
 * @property {boolean} own whether the own vehicle is drawn
 */

/**
 * Return the sight of a camera.
 *
 * @param {Three} three
 * @param {Camera} camera whose matrices are those of the picture
 * @param {number} plain_m see Sight
 * @param {boolean} own whether the own vehicle is drawn
 * @returns {Sight}
 */
export function sightOf(three, camera, plain_m, own) {
  const both = new three.Matrix4().multiplyMatrices(camera.projectionMatrix,
    camera.matrixWorldInverse);
  const frustum = new three.Frustum().setFromProjectionMatrix(both);
  const planes = new Float64Array(24);
  frustum.planes.forEach(({ normal: { x, y, z }, constant }, i) => {
    planes.set([x, y, z, constant], 4 * i);
  });
  return { planes, eye: camera.position, plain_m, own };
}

/**
 * @param {Float64Array} planes see Sight
 * @param {number} x
 * @param {number} y
 * @param {number} z
 * @param {number} radius [m]
 * @returns {boolean} whether a ball may be visible
 */
export function isWithin(planes, x, y, z, radius) {
  for (let i = 0; i < 24; i += 4) {
    if (planes[i] * x + planes[i + 1] * y + planes[i + 2] * z + planes[i + 3] < -radius) {
      return false;
    }
  }
  return true;
}

/**
 * The shapes of near and far instances, in parts of several materials.
 *
 * @typedef {object} Part
 * @property {BufferGeometry} geometry
 * @property {Material} material
 * @property {boolean} tinted whether each instance has a colour of its own
 */
/**
 * @typedef {object} Shapes
 * @property {Part[]} near
 * @property {Part[]} [far] the plain ones, of one material; without them the near ones are drawn
 *   at any distance
 * @property {number} [sooner] share of a sight's `plain_m` at which the plain ones begin; with 0
 * all are plain if any is
 */

/**
 * Return a shape as a plain one, for things whose number costs more than their triangles.
 *
 * @param {Part} part of a material without vertex colours
 * @returns {Part} whose material has to be freed, too
 */
export function mergeable({ geometry, material, tinted }) {
  const own = material.clone();
  own.vertexColors = true;
  return { geometry: geometry.clone(), material: own, tinted };
}

/** Instances that are added anew whenever they move; `see` chooses among them. */
export class SeenInstances {
  /** @type {Mesh[]} those of the near shape, then that of the plain one */
  meshes;
  #near;
  #far;
  #sooner;
  #bound;
  #matrices;
  #colors;
  #own;
  #count = 0;

  /**
   * @param {Three} three
   * @param {Shapes} shapes
   * @param {number} most how many there can be
   */
  constructor(three, { near, far = [], sooner = 1 }, most) {
    this.#sooner = sooner;
    this.#bound = boundOf(near);
    this.#matrices = new Float32Array(16 * most);
    this.#colors = new Float32Array(3 * most);
    this.#own = new Uint8Array(most);
    this.#near = createGroup(three, near, most);
    this.#far = far.length > 0 ? new MergedMesh(three, far, most) : null;
    far.forEach(({ geometry }) => geometry.dispose());
    this.meshes = [...this.#near.meshes, ...(this.#far === null ? [] : [this.#far.mesh])];
  }

  /** Remove all instances. */
  clear() {
    this.#count = 0;
  }

  /**
   * @param {Matrix4} matrix
   * @param {Color|null} color null keeps the colour of the former instance at this index
   * @param {boolean} own whether it is of the vehicle in which the camera may be
   */
  add(matrix, color, own) {
    matrix.toArray(this.#matrices, 16 * this.#count);
    color?.toArray(this.#colors, 3 * this.#count);
    this.#own[this.#count] = own ? 1 : 0;
    this.#count += 1;
  }

  /** Submit all of them, visible or not. */
  seeAll() {
    this.#choose(null);
  }

  /**
   * Submit those that a camera sees.
   *
   * @param {Sight} sight
   */
  see(sight) {
    this.#choose(sight);
  }

  /** @param {Sight|null} sight */
  #choose(sight) {
    let near = 0;
    this.#far?.begin();
    for (let i = 0; i < this.#count; i += 1) {
      if (sight !== null && !this.#mayBeSeen(i, sight)) {
        continue;
      }
      // At full detail nothing is plain, whatever `sooner` is.
      if (sight !== null && this.#far !== null && sight.plain_m < Infinity
          && this.#distance(i, sight) > this.#sooner * sight.plain_m) {
        this.#far.add(this.#matrices, this.#colors, i);
      } else {
        this.#copy(i, this.#near, near);
        near += 1;
      }
    }
    handOver(this.#near, near);
    this.#far?.end();
  }

  /**
   * @param {number} i
   * @param {Sight} sight
   */
  #mayBeSeen(i, { planes, own }) {
    if (this.#own[i] === 1 && !own) {
      return false;
    }
    const m = this.#matrices;
    const o = 16 * i;
    const { x, y, z, radius } = this.#bound;
    const scale = Math.sqrt(Math.max(m[o] ** 2 + m[o + 1] ** 2 + m[o + 2] ** 2,
      m[o + 4] ** 2 + m[o + 5] ** 2 + m[o + 6] ** 2,
      m[o + 8] ** 2 + m[o + 9] ** 2 + m[o + 10] ** 2));
    return isWithin(planes, m[o] * x + m[o + 4] * y + m[o + 8] * z + m[o + 12],
      m[o + 1] * x + m[o + 5] * y + m[o + 9] * z + m[o + 13],
      m[o + 2] * x + m[o + 6] * y + m[o + 10] * z + m[o + 14], radius * scale);
  }

  /**
   * @param {number} i
   * @param {Sight} sight
   * @returns {number} from the eye, in the plane [m]
   */
  #distance(i, { eye }) {
    return Math.hypot(this.#matrices[16 * i + 12] - eye.x, this.#matrices[16 * i + 13] - eye.y);
  }

  /**
   * @param {number} i
   * @param {Group} group
   * @param {number} to
   */
  #copy(i, { places, colors: { array } }, to) {
    const target = places.array;
    for (let k = 0; k < 16; k += 1) {
      target[16 * to + k] = this.#matrices[16 * i + k];
    }
    for (let k = 0; k < 3; k += 1) {
      array[3 * to + k] = this.#colors[3 * i + k];
    }
  }

  /** Free the memory of the graphics card, except the materials. */
  dispose() {
    for (const mesh of this.#near.meshes) {
      mesh.removeFromParent();
      mesh.geometry.dispose();
      mesh.dispose();
    }
    this.#far?.dispose();
  }
}

/**
 * @param {Part[]} parts
 * @returns {{x: number, y: number, z: number, radius: number}} a ball around all of them
 */
function boundOf(parts) {
  const bound = { x: 0, y: 0, z: 0, radius: 0 };
  parts.forEach(({ geometry }, i) => {
    geometry.computeBoundingSphere();
    const { center: { x, y, z }, radius } = /** @type {import('three').Sphere} */ (
      geometry.boundingSphere);
    if (i === 0) {
      Object.assign(bound, { x, y, z });
    }
    bound.radius = Math.max(bound.radius,
      radius + Math.hypot(x - bound.x, y - bound.y, z - bound.z));
  });
  return bound;
}

/**
 * @typedef {object} Group meshes that share places and colours
 * @property {InstancedMesh[]} meshes
 * @property {InstancedBufferAttribute} places
 * @property {InstancedBufferAttribute} colors
 */

/**
 * @param {Three} three
 * @param {Part[]} parts
 * @param {number} most
 * @returns {Group}
 */
function createGroup(three, parts, most) {
  const places = new three.InstancedBufferAttribute(new Float32Array(16 * Math.max(most, 1)), 16);
  const colors = new three.InstancedBufferAttribute(new Float32Array(3 * Math.max(most, 1)), 3);
  places.setUsage(three.DynamicDrawUsage);
  colors.setUsage(three.DynamicDrawUsage);
  const meshes = parts.map(({ geometry, material, tinted }) => {
    const mesh = new three.InstancedMesh(geometry, material, 0);
    mesh.instanceMatrix = places;
    // Set at once, because the program of a mesh is built for instances with or without colours.
    mesh.instanceColor = tinted ? colors : null;
    // Culling is done by this class.
    mesh.frustumCulled = false;
    mesh.matrixAutoUpdate = false;
    mesh.visible = false;
    return mesh;
  });
  return { meshes, places, colors };
}

/**
 * @param {Group} group
 * @param {number} count
 */
function handOver({ meshes, places, colors }, count) {
  for (const mesh of meshes) {
    mesh.count = count;
    mesh.visible = count > 0;
  }
  if (count > 0) {
    for (const attribute of [places, colors]) {
      attribute.clearUpdateRanges();
      attribute.addUpdateRange(0, count * attribute.itemSize);
      attribute.needsUpdate = true;
    }
  }
}
