// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Parts that all vehicles share: wheels, lit lamps, and shadows. */

import { MeshBuilder } from './bodies/mesh_builder.js';
import { Instances } from './instances.js';
import { mergeable, SeenInstances } from './seen_instances.js';

import type { Group, Matrix4, MeshBasicMaterial } from 'three';
import type { Body } from './bodies/motor_vehicles.js';
import type { Three } from './three.js';
import type { Part, Sight } from './seen_instances.js';

export type Scale = [x: number, y: number, z: number];
export interface Lit { brakes: boolean; left: boolean; right: boolean }

const BRAKE = 0xff2a16;
const AMBER = 0xffa000;
const BLUE = 0x2f6bff;
const WHITE = 0xffffff;
const SHADOW_TEXELS = 32;
const SHADOW_DARKNESS = 0.55;
const SHADOW_ABOVE_M = 0.025;
const SHADOW_BEYOND_M = 0.35;
const PER_VEHICLE = 4;
// Small wheels need few corners.
const PLAIN_WHEELS_SOONER = 0.35;

/** Instances of the parts; see Instances for `own`. */
export class FittedParts {
  #three;
  #group;
  #wheels: Instances | null = null;
  #lamps: SeenInstances | null = null;
  #shadows: SeenInstances | null = null;
  #materials: MeshBasicMaterial[] = [];
  #color;
  #matrix;
  #step;
  #pitch;
  #vector;

  constructor(three: Three, group: Group) {
    this.#three = three;
    this.#group = group;
    this.#color = new three.Color();
    this.#matrix = new three.Matrix4();
    this.#step = new three.Matrix4();
    this.#pitch = new three.Matrix4();
    this.#vector = new three.Vector3();
  }

  /** @param count of things that may have them */
  load(count: number) {
    this.dispose();
    const most = Math.max(PER_VEHICLE * count, 1);
    this.#wheels = new Instances(this.#three, this.#group, wheel(), most, plainWheel(),
      PLAIN_WHEELS_SOONER);
    const [lamp, shadow] = [lampPart(this.#three), shadowPart(this.#three)];
    const plain = [lamp, shadow].map(mergeable);
    this.#materials = [lamp, shadow, ...plain].map(
      ({ material }) => material as MeshBasicMaterial);
    this.#lamps = new SeenInstances(this.#three, { near: [lamp], far: [plain[0]], sooner: 0 },
      2 * most);
    this.#shadows = new SeenInstances(this.#three, { near: [shadow], far: [plain[1]], sooner: 0 },
      Math.max(count, 1));
    // Drawn after the road and its markings.
    this.#shadows.meshes.forEach((mesh) => { mesh.renderOrder = 5; });
    this.#group.add(...this.#lamps.meshes, ...this.#shadows.meshes);
  }

  /** Remove all instances, before they are added anew. */
  clear() {
    this.#all.forEach((parts) => parts?.clear());
  }

  /** @param sight of the camera that draws next */
  see(sight: Sight) {
    this.#all.forEach((parts) => parts?.see(sight));
  }

  /** Free the memory of the graphics card. */
  dispose() {
    this.#all.forEach((parts) => parts?.dispose());
    disposeOf(this.#materials);
    this.#materials = [];
  }

  get #all() {
    return [this.#wheels, this.#lamps, this.#shadows];
  }

  /** Return what pitches a level body, the same object each time; `slope` upwards [rad]. */
  pitched(slope: number): Matrix4 {
    return this.#pitch.makeRotationY(-slope);
  }

  /**
   * @param place of the vehicle's middle
   * @param scale of the body
   * @param steering of the front wheels [rad]
   * @param rolled [m]
   */
  addWheels(place: Matrix4, { front, rear, track, radius, width }: NonNullable<Body['wheels']>,
    [sx, sy]: Scale, steering: number, rolled: number, own: boolean) {
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

  /** `place` of the vehicle's middle; `scale` of the body. */
  addLamps(place: Matrix4, { front, rear, size: [width, height] }: NonNullable<Body['lamps']>,
    [sx, sy, sz]: Scale, lit: Lit, own: boolean) {
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
   * Add the blue lights of a priority vehicle to its roof.
   * @param place of the vehicle's middle
   * @param scale of the body
   */
  addBlueLights(place: Matrix4, { height }: Body, [, sy, sz]: Scale, own: boolean) {
    for (const side of [1, -1]) {
      this.#addLamp(place, 0, side * 0.35 * sy, (height + 0.05) * sz, 0.4 * sy, 0.12, BLUE, own);
    }
  }

  /** `place` of the thing's middle; `length` of its footprint [m]; `width` [m]. */
  addShadow(place: Matrix4, length: number, width: number, own: boolean) {
    this.#matrix.copy(place)
      .multiply(this.#step.makeTranslation(0, 0, SHADOW_ABOVE_M))
      .scale(this.#vector.set(length + SHADOW_BEYOND_M, width + SHADOW_BEYOND_M, 1));
    this.#shadows?.add(this.#matrix, null, own);
  }

  /** `width` [m]; `height` [m]. */
  #addLamp(place: Matrix4, x: number, y: number, z: number, width: number, height: number,
    color: number, own: boolean) {
    this.#matrix.copy(place).multiply(this.#step.makeTranslation(x, y, z))
      .scale(this.#vector.set(0.03, width, height));
    this.#lamps?.add(this.#matrix, this.#color.setHex(color), own);
  }
}

/** Free the memory of materials and their pictures. */
export function disposeOf(materials: MeshBasicMaterial[]) {
  materials.forEach((material) => {
    material.map?.dispose();
    material.dispose();
  });
}

/** @returns lamps that shine, independent of the light */
export function lampPart(three: Three): Part {
  return { geometry: new three.BoxGeometry(1, 1, 1), tinted: true,
    material: new three.MeshBasicMaterial({ toneMapped: false }) };
}

/** @returns shadows as dark, soft patches on the road */
function shadowPart(three: Three): Part {
  return { geometry: new three.PlaneGeometry(1, 1), tinted: false,
    material: new three.MeshBasicMaterial({ color: 0, map: softPatch(three), transparent: true,
      depthWrite: false, polygonOffset: true, polygonOffsetFactor: -2,
      polygonOffsetUnits: -2 }) };
}

function softPatch(three: Three) {
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

/** The same with few corners, for wheels that are small in the picture. */
function plainWheel() {
  return new MeshBuilder()
    .cylinder([0, 0, 0], 'y', 1, 1, [0.05, 0.05, 0.055], [0.05, 0.05, 0.055], 8)
    .cylinder([0, 0, 0], 'y', 1.02, 0.66, [0.38, 0.39, 0.41], [0.38, 0.39, 0.41], 6);
}
