// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Instances of one shape, of which a picture draws those visible to its camera. */

import { MergedMesh } from './merged_mesh.js';

import type {
  BufferGeometry, Camera, Color, InstancedBufferAttribute, InstancedMesh, Material, Matrix4, Mesh,
  Sphere,
} from 'three';
import type { Three } from './three.js';

/**
 * The sight of a camera: instances out of sight are not submitted to the renderer, and those that
 * are small in the picture have fewer triangles.
 */
export interface Sight {
  // six of them, four numbers each: a point within has a x + b y + c z + d >= 0, from the local
  // origin
  planes: Float64Array;
  eye: { x: number; y: number }; // from the local origin [m]
  plain_m: number; // beyond it the plain shape is drawn
  own: boolean; // whether the own vehicle is drawn
}

/**
 * Return the sight of a camera.
 * @param camera whose matrices are those of the picture
 * @param plain_m see Sight
 * @param own whether the own vehicle is drawn
 */
export function sightOf(three: Three, camera: Camera, plain_m: number, own: boolean): Sight {
  const both = new three.Matrix4().multiplyMatrices(camera.projectionMatrix,
    camera.matrixWorldInverse);
  const frustum = new three.Frustum().setFromProjectionMatrix(both);
  const planes = new Float64Array(24);
  frustum.planes.forEach(({ normal: { x, y, z }, constant }, i) => {
    planes.set([x, y, z, constant], 4 * i);
  });
  return { planes, eye: camera.position, plain_m, own };
}

/** Return whether a ball may be visible; `planes`: see Sight; `radius` [m]. */
export function isWithin(planes: Float64Array, x: number, y: number, z: number,
  radius: number): boolean {
  for (let i = 0; i < 24; i += 4) {
    if (planes[i] * x + planes[i + 1] * y + planes[i + 2] * z + planes[i + 3] < -radius) {
      return false;
    }
  }
  return true;
}

/** The shapes of near and far instances, in parts of several materials. */
export interface Part {
  geometry: BufferGeometry;
  material: Material;
  tinted: boolean; // whether each instance has a colour of its own
}

export interface Shapes {
  near: Part[];
  // the plain ones, of one material; without them the near ones are drawn at any distance
  far?: Part[];
  // share of a sight's `plain_m` at which the plain ones begin; with 0 all are plain if any is
  sooner?: number;
}

/**
 * Return a shape as a plain one, for things whose number costs more than their triangles.
 * @param part of a material without vertex colours
 * @returns whose material has to be freed, too
 */
export function mergeable({ geometry, material, tinted }: Part): Part {
  const own = material.clone();
  own.vertexColors = true;
  return { geometry: geometry.clone(), material: own, tinted };
}

/** Instances that are added anew whenever they move; `see` chooses among them. */
export class SeenInstances {
  meshes: Mesh[]; // those of the near shape, then that of the plain one
  #near;
  #far;
  #sooner;
  #bound;
  #matrices;
  #colors;
  #own;
  #count = 0;

  /** @param most how many there can be */
  constructor(three: Three, { near, far = [], sooner = 1 }: Shapes, most: number) {
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
   * @param color null keeps the colour of the former instance at this index
   * @param own whether it is of the vehicle in which the camera may be
   */
  add(matrix: Matrix4, color: Color | null, own: boolean) {
    matrix.toArray(this.#matrices, 16 * this.#count);
    color?.toArray(this.#colors, 3 * this.#count);
    this.#own[this.#count] = own ? 1 : 0;
    this.#count += 1;
  }

  /** Submit those that a camera sees; without a sight all, visible or not. */
  see(sight: Sight | null) {
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

  #mayBeSeen(i: number, { planes, own }: Sight) {
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

  /** @returns from the eye, in the plane [m] */
  #distance(i: number, { eye }: Sight): number {
    return Math.hypot(this.#matrices[16 * i + 12] - eye.x, this.#matrices[16 * i + 13] - eye.y);
  }

  #copy(i: number, { places, colors: { array } }: Group, to: number) {
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

/** @returns a ball around all of them */
function boundOf(parts: Part[]): { x: number; y: number; z: number; radius: number } {
  const bound = { x: 0, y: 0, z: 0, radius: 0 };
  parts.forEach(({ geometry }, i) => {
    geometry.computeBoundingSphere();
    const { center: { x, y, z }, radius } = geometry.boundingSphere as Sphere;
    if (i === 0) {
      Object.assign(bound, { x, y, z });
    }
    bound.radius = Math.max(bound.radius,
      radius + Math.hypot(x - bound.x, y - bound.y, z - bound.z));
  });
  return bound;
}

/** Meshes that share places and colours. */
export interface Group {
  meshes: InstancedMesh[];
  places: InstancedBufferAttribute;
  colors: InstancedBufferAttribute;
}

function createGroup(three: Three, parts: Part[], most: number): Group {
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

function handOver({ meshes, places, colors }: Group, count: number) {
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
