// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * Many things of one shape as a single mesh, filled anew for each picture. A graphics card draws
 * instances as fast. A renderer on the processor needs as long for an instance as for a draw call.
 */

import type { BufferAttribute, BufferGeometry, Mesh } from 'three';
import type { Part } from './seen_instances.js';
import type { Three } from './three.js';

// Attributes that are copied unchanged, and their numbers per corner.
const COPIED: Record<string, number> = { uv: 2, rank: 1 };

/** The corners of all parts of a shape, one after the other. */
class Corners {
  positions: number[] = [];
  normals: number[] = [];
  colors: number[] = [];
  tinted: boolean[] = []; // whether the colour is multiplied by that of the thing
  indices: number[] = [];
  copied: Record<string, number[]> = {};

  constructor(parts: Part[]) {
    for (const { geometry, tinted } of parts) {
      this.#add(geometry, tinted);
    }
  }

  get count() {
    return this.tinted.length;
  }

  #add({ attributes, index }: BufferGeometry, tinted: boolean) {
    const first = this.count;
    const { count } = attributes.position;
    this.positions.push(...attributes.position.array);
    this.normals.push(...attributes.normal.array);
    this.colors.push(...(attributes.color?.array ?? new Array(3 * count).fill(1)));
    this.tinted.push(...new Array(count).fill(tinted));
    this.indices.push(...Array.from(index?.array ?? Array.from({ length: count }, (_, i) => i),
      (corner) => first + corner));
    for (const name of Object.keys(COPIED)) {
      if (attributes[name] !== undefined) {
        (this.copied[name] ??= []).push(...attributes[name].array);
      }
    }
  }
}

/** One mesh; `begin`, `add` for each thing, `end`. */
export class MergedMesh {
  mesh: Mesh;
  #corners;
  #positions;
  #normals;
  #colors;
  #count = 0;

  /** `parts` of one material; `most`: how many things there can be. */
  constructor(three: Three, parts: Part[], most: number) {
    const corners = new Corners(parts);
    this.#corners = corners;
    const geometry = new three.BufferGeometry();
    const attribute = (name: string, size: number): BufferAttribute => {
      const made = new three.BufferAttribute(new Float32Array(size * corners.count * most), size);
      geometry.setAttribute(name, made);
      return made;
    };
    const filled = (
      name: string): BufferAttribute => attribute(name, 3).setUsage(three.DynamicDrawUsage);
    this.#positions = filled('position');
    this.#normals = filled('normal');
    this.#colors = filled('color');
    for (const [name, values] of Object.entries(corners.copied)) {
      const { array } = attribute(name, COPIED[name]);
      for (let i = 0; i < most; i += 1) {
        array.set(values, i * values.length);
      }
    }
    const indices = new Uint32Array(corners.indices.length * most);
    for (let i = 0; i < most; i += 1) {
      indices.set(corners.indices.map((corner) => corner + i * corners.count),
        i * corners.indices.length);
    }
    geometry.setIndex(new three.BufferAttribute(indices, 1));
    this.mesh = new three.Mesh(geometry, parts[0].material);
    this.mesh.frustumCulled = false;
    this.mesh.matrixAutoUpdate = false;
    this.mesh.visible = false;
  }

  begin() {
    this.#count = 0;
  }

  /** `m`: matrices; `tints`: colours; `which` of them. */
  add(m: Float32Array, tints: Float32Array, which: number) {
    const { count, positions, normals, colors, tinted } = this.#corners;
    const [o, c] = [16 * which, 3 * which];
    // As three.js transforms normals of scaled instances: by the inverse of the squared scales.
    const sx = 1 / (m[o] ** 2 + m[o + 1] ** 2 + m[o + 2] ** 2);
    const sy = 1 / (m[o + 4] ** 2 + m[o + 5] ** 2 + m[o + 6] ** 2);
    const sz = 1 / (m[o + 8] ** 2 + m[o + 9] ** 2 + m[o + 10] ** 2);
    const [to, normal, color] = [this.#positions.array, this.#normals.array, this.#colors.array];
    let at = 3 * count * this.#count;
    for (let i = 0; i < 3 * count; i += 3) {
      const [x, y, z] = [positions[i], positions[i + 1], positions[i + 2]];
      const [nx, ny, nz] = [normals[i] * sx, normals[i + 1] * sy, normals[i + 2] * sz];
      const isTinted = tinted[i / 3];
      for (let axis = 0; axis < 3; axis += 1) {
        const [u, v, w] = [m[o + axis], m[o + 4 + axis], m[o + 8 + axis]];
        to[at + axis] = u * x + v * y + w * z + m[o + 12 + axis];
        normal[at + axis] = u * nx + v * ny + w * nz;
        color[at + axis] = colors[i + axis] * (isTinted ? tints[c + axis] : 1);
      }
      at += 3;
    }
    this.#count += 1;
  }

  /** End a picture, so that the added things are drawn. */
  end() {
    this.mesh.visible = this.#count > 0;
    this.mesh.geometry.setDrawRange(0, this.#corners.indices.length * this.#count);
    if (this.#count > 0) {
      for (const attribute of [this.#positions, this.#normals, this.#colors]) {
        attribute.clearUpdateRanges();
        attribute.addUpdateRange(0, 3 * this.#corners.count * this.#count);
        attribute.needsUpdate = true;
      }
    }
  }

  /** Free the memory of the graphics card, except the material. */
  dispose() {
    this.mesh.removeFromParent();
    this.mesh.geometry.dispose();
  }
}
