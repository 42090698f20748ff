// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The signs of a scene: all plates as one mesh, and their poles. */

import { geometryOf } from './materials.js';
import { MeshParts } from './mesh_parts.js';
import { addRound } from './scenery_shapes.js';
import { NearInstances } from './near_instances.js';
import { upright } from '../solid_boxes.js';
import { SignAtlas } from './sign_atlas.js';
import { faceOf } from './sign_faces.js';

import type { CanvasTexture, Material } from 'three';
import type { Origin } from '../local_origin.js';
import type { Heights } from './mesh_parts.js';
import type { PlateShape } from './sign_faces.js';
import type { SignPole } from './poles.js';
import type { Cell } from './sign_atlas.js';
import type { Sight } from '../seen_instances.js';
import type { Three } from '../three.js';
import type { Named } from '../contents.js';

// Heights of the lower edge of the lowest plate, and of one above a road [m].
const LOWEST_M = 2.0;
const HANGING_M = 5.2;
const GAP_M = 0.06;
const PLATE_OFF_POLE_M = 0.045;
/** Edge of the square that a plate is drawn in [m]. */
const SIZE_M: Record<PlateShape, number> = {
  circle: 0.75, triangle: 0.95, yield: 0.95, octagon: 0.95, diamond: 0.85, square: 0.8, wide: 1.7,
  tall: 1.0,
};
const STEEL = 0x8f9499;
const MOST_POLES = 400;
const REACH_M = 600;

/** All signs of a scene. */
export class Signs {
  /** The plates of each pole. */
  solids: Named[];
  #texture;
  #plates;
  #poles;

  /** `country`: three letters; `painted` of the poles. */
  constructor(three: Three, signs: SignPole[], country: string, origin: Origin, heights: Heights,
    painted: Material) {
    const atlas = new SignAtlas();
    const quads = new PlateQuads(origin);
    this.solids = [];
    const poles = signs.map((sign) => {
      const ground = heights(sign.x, sign.y);
      const { top, bottom, width } = quads.addPole(sign, ground, atlas, country);
      this.solids.push({ kind: 'sign', id: String(sign.id), ...upright(sign.x - origin.x,
        sign.y - origin.y, sign.yaw, [-PLATE_OFF_POLE_M, -width / 2, bottom],
        [PLATE_OFF_POLE_M, width / 2, top]) });
      return { x: sign.x - origin.x, y: sign.y - origin.y, z: ground, yaw: 0,
        size: [1, 1, sign.hangs ? 0 : top - ground] as [number, number, number],
        color: STEEL };
    });
    this.#texture = plateTexture(three, atlas.canvas);
    this.#plates = new three.Mesh(quads.geometry(three), new three.MeshLambertMaterial({
      map: this.#texture, alphaTest: 0.5,
      // Signs are retroreflective, and readable at dusk.
      emissive: 0xffffff, emissiveMap: this.#texture, emissiveIntensity: 0.22 }));
    const shape = new MeshParts({ x: 0, y: 0 });
    addRound(shape, [[0.038, -0.3], [0.038, 1]], [255, 255, 255]);
    this.#poles = new NearInstances(three, geometryOf(three, shape), painted, poles, MOST_POLES,
      REACH_M);
  }

  get meshes() {
    return [this.#plates, ...this.#poles.meshes];
  }

  get triangles() {
    return (this.#plates.geometry.index?.count ?? 0) / 3 + this.#poles.triangles;
  }

  update(eye: { x: number; y: number }) {
    this.#poles.update(eye);
  }

  /** @param sight of the camera that draws next */
  see(sight: Sight) {
    this.#poles.see(sight);
  }

  /** Free the memory of the graphics card. */
  dispose() {
    this.#texture.dispose();
    this.#plates.geometry.dispose();
    this.#plates.material.dispose();
    this.#poles.dispose();
  }
}

export function plateTexture(three: Three, canvas: HTMLCanvasElement): CanvasTexture {
  const texture = new three.CanvasTexture(canvas);
  texture.colorSpace = three.SRGBColorSpace;
  texture.anisotropy = 8;
  return texture;
}

/** Upright squares with pictures. */
export class PlateQuads {
  positions: number[] = [];
  normals: number[] = [];
  uvs: number[] = [];
  indices: number[] = [];
  #origin;

  constructor(origin: Origin) {
    this.#origin = origin;
  }

  /**
   * Add the plates of a pole, the first on top, and their backs.
   * @param ground its height [m]
   * @returns the heights of their edges, and the width of the widest [m]
   */
  addPole({ x, y, yaw, hangs, plates }: SignPole, ground: number, atlas: SignAtlas,
    country: string): { bottom: number; top: number; width: number } {
    const lowest = ground + (hangs ? HANGING_M : LOWEST_M);
    let bottom = lowest;
    let width = 0;
    for (const { kind, value } of plates.toReversed()) {
      const face = faceOf(kind, value, country);
      const size = SIZE_M[face.shape];
      const height = face.shape === 'wide' ? size / 2 : size;
      const z = bottom + height / 2;
      const off = (
        meters: number) => [x - meters * Math.cos(yaw), y - meters * Math.sin(yaw)] as const;
      this.add(...off(PLATE_OFF_POLE_M), z, yaw, size, atlas.cellOf(face));
      this.add(...off(PLATE_OFF_POLE_M - 0.01), z, yaw + Math.PI, size, atlas.backOf(face.shape));
      bottom += height + GAP_M;
      width = Math.max(width, size);
    }
    return { bottom: lowest, top: bottom - GAP_M, width };
  }

  /**
   * Add a square.
   * @param x of its middle
   * @param z [m]
   * @param yaw heading of the traffic that sees it [rad]
   * @param size [m]
   * @param cell its picture
   */
  add(x: number, y: number, z: number, yaw: number, size: number, [u0, v0, u1, v1]: Cell) {
    const left = { x: -Math.sin(yaw) * size / 2, y: Math.cos(yaw) * size / 2 };
    const first = this.positions.length / 3;
    for (const [side, up] of [[1, -1], [-1, -1], [-1, 1], [1, 1]]) {
      this.positions.push(x - this.#origin.x + side * left.x, y - this.#origin.y + side * left.y,
        z + up * size / 2);
      this.normals.push(-Math.cos(yaw), -Math.sin(yaw), 0);
      this.uvs.push(side > 0 ? u0 : u1, 1 - (up > 0 ? v0 : v1));
    }
    this.indices.push(first, first + 1, first + 2, first, first + 2, first + 3);
  }

  geometry(three: Three) {
    const geometry = new three.BufferGeometry();
    geometry.setAttribute('position', new three.Float32BufferAttribute(this.positions, 3));
    geometry.setAttribute('normal', new three.Float32BufferAttribute(this.normals, 3));
    geometry.setAttribute('uv', new three.Float32BufferAttribute(this.uvs, 2));
    geometry.setIndex(this.indices);
    return geometry;
  }
}
