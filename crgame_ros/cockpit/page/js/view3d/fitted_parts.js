// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** What all vehicles have alike: wheels, lamps that are on, and shadows. */

import { MeshBuilder } from './bodies/mesh_builder.js';
import { Instances } from './instances.js';

/** @import { Group, Matrix4 } from 'three' */
/** @import { Body } from './bodies/motor_vehicles.js' */
/** @import { Three } from './road/road_world.js' */

/** @typedef {[x: number, y: number, z: number]} Scale */
/** @typedef {{brakes: boolean, left: boolean, right: boolean}} Lit */

const BRAKE = 0xff2a16;
const AMBER = 0xffa000;
const WHITE = 0xffffff;
const SHADOW_TEXELS = 32;
const SHADOW_DARKNESS = 0.55;
const SHADOW_ABOVE_M = 0.025;
const SHADOW_BEYOND_M = 0.35;
const PER_VEHICLE = 4;

/** Instances of the parts; see Instances for what is own. */
export class FittedParts {
  #three;
  #group;
  /** @type {Instances|null} */
  #wheels = null;
  /** @type {LampInstances|null} */
  #lamps = null;
  /** @type {ShadowInstances|null} */
  #shadows = null;
  #matrix;
  #step;
  #pitch;
  #vector;

  /**
   * @param {Three} three
   * @param {Group} group
   */
  constructor(three, group) {
    this.#three = three;
    this.#group = group;
    this.#matrix = new three.Matrix4();
    this.#step = new three.Matrix4();
    this.#pitch = new three.Matrix4();
    this.#vector = new three.Vector3();
  }

  /** @param {number} count of things that may have them */
  load(count) {
    this.dispose();
    const most = Math.max(PER_VEHICLE * count, 1);
    this.#wheels = new Instances(this.#three, this.#group, wheel(), most);
    this.#lamps = new LampInstances(this.#three, this.#group, 2 * most);
    this.#shadows = new ShadowInstances(this.#three, this.#group, Math.max(count, 1));
  }

  /** Nothing is shown until it is added anew. */
  clear() {
    for (const parts of [this.#wheels, this.#lamps, this.#shadows]) {
      parts?.clear();
    }
  }

  /** What was added is shown. */
  commit() {
    for (const parts of [this.#wheels, this.#lamps, this.#shadows]) {
      parts?.commit();
    }
  }

  /** @param {boolean} shown whether those of the own vehicle are drawn */
  showOwn(shown) {
    for (const parts of [this.#wheels, this.#lamps, this.#shadows]) {
      parts?.showOwn(shown);
    }
  }

  /** Free what the graphics card holds. */
  dispose() {
    for (const parts of [this.#wheels, this.#lamps, this.#shadows]) {
      parts?.dispose();
    }
  }

  /**
   * @param {number} slope upwards [rad]
   * @returns {Matrix4} that turns what is level; the same one each time
   */
  pitched(slope) {
    return this.#pitch.makeRotationY(-slope);
  }

  /**
   * @param {Matrix4} place of the vehicle's middle
   * @param {NonNullable<Body['wheels']>} wheels
   * @param {Scale} scale of the body
   * @param {number} steering of the front wheels [rad]
   * @param {number} rolled [m]
   * @param {boolean} own
   */
  addWheels(place, { front, rear, track, radius, width }, [sx, sy], steering, rolled, own) {
    const aside = 0.5 * (track * sy - width);
    const sides = aside > 0.5 * width ? [-aside, aside] : [0];
    for (const [x, angle] of [[front, steering], [rear, 0]]) {
      for (const y of sides) {
        this.#matrix.copy(place)
          .multiply(this.#step.makeTranslation(x * sx, y, radius))
          .multiply(this.#step.makeRotationZ(angle))
          .multiply(this.#step.makeRotationY(rolled / radius))
          .scale(this.#vector.set(radius, width, radius));
        this.#wheels?.add(this.#matrix, WHITE, own);
      }
    }
  }

  /**
   * @param {Matrix4} place of the vehicle's middle
   * @param {NonNullable<Body['lamps']>} lamps
   * @param {Scale} scale of the body
   * @param {Lit} lit
   * @param {boolean} own
   */
  addLamps(place, { front, rear, size: [width, height] }, [sx, sy, sz], lit, own) {
    for (const side of [1, -1]) {
      if (lit.brakes) {
        this.#addLamp(place, (rear[0] - 0.035) * sx, side * rear[1] * sy, rear[2] * sz,
          width * sy, height * sz, BRAKE, own);
      }
      if (side > 0 ? lit.left : lit.right) {
        this.#addLamp(place, (front[0] + 0.035) * sx, side * front[1] * 1.1 * sy, front[2] * sz,
          0.14, 0.1, AMBER, own);
        this.#addLamp(place, (rear[0] - 0.045) * sx, side * rear[1] * 1.1 * sy,
          (rear[2] - 0.1) * sz, 0.16, 0.1, AMBER, own);
      }
    }
  }

  /**
   * @param {Matrix4} place of the thing's middle
   * @param {number} length of its footprint [m]
   * @param {number} width [m]
   * @param {boolean} own
   */
  addShadow(place, length, width, own) {
    this.#matrix.copy(place)
      .multiply(this.#step.makeTranslation(0, 0, SHADOW_ABOVE_M))
      .scale(this.#vector.set(length + SHADOW_BEYOND_M, width + SHADOW_BEYOND_M, 1));
    this.#shadows?.add(this.#matrix, own);
  }

  /**
   * @param {Matrix4} place
   * @param {number} x
   * @param {number} y
   * @param {number} z
   * @param {number} width [m]
   * @param {number} height [m]
   * @param {number} color
   * @param {boolean} own
   */
  #addLamp(place, x, y, z, width, height, color, own) {
    this.#matrix.copy(place).multiply(this.#step.makeTranslation(x, y, z))
      .scale(this.#vector.set(0.03, width, height));
    this.#lamps?.add(this.#matrix, color, own);
  }
}

/** Things of one mesh, each with its matrix, those of the own vehicle last. */
class PlainInstances {
  #count = 0;
  #shared = 0;

  /**
   * @param {Group} group
   * @param {import('three').InstancedMesh} mesh
   */
  constructor(group, mesh) {
    this.mesh = mesh;
    mesh.frustumCulled = false;
    mesh.count = 0;
    group.add(mesh);
  }

  clear() {
    this.#count = 0;
    this.#shared = 0;
  }

  /**
   * @param {Matrix4} matrix
   * @param {boolean} own
   * @returns {number} its index
   */
  put(matrix, own) {
    this.mesh.setMatrixAt(this.#count, matrix);
    this.#shared += own ? 0 : 1;
    this.#count += 1;
    return this.#count - 1;
  }

  commit() {
    this.mesh.count = this.#count;
    this.mesh.instanceMatrix.needsUpdate = true;
    if (this.mesh.instanceColor !== null) {
      this.mesh.instanceColor.needsUpdate = true;
    }
  }

  /** @param {boolean} shown */
  showOwn(shown) {
    this.mesh.count = shown ? this.#count : this.#shared;
  }

  dispose() {
    this.mesh.removeFromParent();
    this.mesh.geometry.dispose();
    this.mesh.dispose();
    const material = /** @type {import('three').MeshBasicMaterial} */ (this.mesh.material);
    material.map?.dispose();
    material.dispose();
  }
}

/** Lamps that shine, whatever the light. */
class LampInstances extends PlainInstances {
  #color;

  /**
   * @param {Three} three
   * @param {Group} group
   * @param {number} most
   */
  constructor(three, group, most) {
    super(group, new three.InstancedMesh(new three.BoxGeometry(1, 1, 1),
      new three.MeshBasicMaterial({ toneMapped: false }), most));
    this.#color = new three.Color();
    this.mesh.setColorAt(0, this.#color);
  }

  /**
   * @param {Matrix4} matrix
   * @param {number} color
   * @param {boolean} own
   */
  add(matrix, color, own) {
    this.mesh.setColorAt(this.put(matrix, own), this.#color.setHex(color));
  }
}

/** Shadows as dark, soft patches on the road. */
class ShadowInstances extends PlainInstances {
  /**
   * @param {Three} three
   * @param {Group} group
   * @param {number} most
   */
  constructor(three, group, most) {
    super(group, new three.InstancedMesh(new three.PlaneGeometry(1, 1),
      new three.MeshBasicMaterial({ color: 0, map: softPatch(three), transparent: true,
        depthWrite: false, polygonOffset: true, polygonOffsetFactor: -2,
        polygonOffsetUnits: -2 }), most));
    // After the road and its markings.
    this.mesh.renderOrder = 5;
  }

  /**
   * @param {Matrix4} matrix
   * @param {boolean} own
   */
  add(matrix, own) {
    this.put(matrix, own);
  }
}

/** @param {Three} three */
function softPatch(three) {
  const data = new Uint8Array(4 * SHADOW_TEXELS * SHADOW_TEXELS);
  for (let i = 0; i < SHADOW_TEXELS * SHADOW_TEXELS; i += 1) {
    const [u, v] = [i % SHADOW_TEXELS, Math.floor(i / SHADOW_TEXELS)]
      .map((texel) => Math.abs((2 * texel + 1) / SHADOW_TEXELS - 1));
    const edge = Math.max(u, v, 0.72 * (u + v));
    const soft = Math.min(Math.max((1 - edge) / 0.35, 0), 1);
    data[4 * i + 3] = 255 * SHADOW_DARKNESS * soft * soft * (3 - 2 * soft);
  }
  const texture = new three.DataTexture(data, SHADOW_TEXELS, SHADOW_TEXELS);
  texture.magFilter = three.LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

/** A wheel of radius 1 and width 1, whose spokes show that it turns. */
function wheel() {
  const mesh = new MeshBuilder()
    .cylinder([0, 0, 0], 'y', 1, 1, [0.05, 0.05, 0.055], [0.05, 0.05, 0.055], 16)
    .cylinder([0, 0, 0], 'y', 1.02, 0.66, [0.3, 0.31, 0.33], [0.3, 0.31, 0.33], 12);
  for (const [x, z] of [[0.62, 0.09], [0.09, 0.62]]) {
    mesh.box([-x, -0.525, -z], [x, 0.525, z], [0.62, 0.63, 0.66]);
  }
  return mesh;
}
