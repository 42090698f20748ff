// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Headlights and tail lamps at dusk and in fog: lamps, their glow, and the light on the road. */

import { disposeOf, lampPart } from './fitted_parts.js';
import { contrastLeft } from './road/fog.js';
import { mergeable, SeenInstances } from './seen_instances.js';

import type { Group, Matrix4, MeshBasicMaterial } from 'three';
import type { Environment } from '../messages.js';
import type { Body } from './bodies/motor_vehicles.js';
import type { Scale } from './fitted_parts.js';
import type { Three } from './three.js';
import type { Part, Sight } from './seen_instances.js';

// By day, low beam is on below this meteorological visibility [m].
const FOGGY_M = 200;
const FRONT = 0xfff4da;
const REAR = 0xc81a10;
const GLOW = { front: { color: 0xfff0d0, size_m: 1.5 }, rear: { color: 0xd01808, size_m: 0.8 } };
// How much brighter a lamp is than white by day, so that fog hides it later.
const GLOW_BRIGHTNESS = 3;
const GLOW_TEXELS = 32;
// Reach of the low beam ahead of the lamps and to both sides [m].
const BEAM = { from: 1.2, to: 30, wide: 13, above: 0.04, near: 6, texels: 64 };
// How much it brightens the road, at dusk and by day, in colours as on the screen.
const BEAM_STRENGTH = { dusk: 0.95, day: 0.07 };
// Distance up to which the light of others on the road is drawn; farther it is hardly visible [m].
const BEAM_SEEN_M = 60;
// Vehicles this near share the light on the road, so that a queue does not make it white [m].
const SHARED_M = 20;

/** Return whether people drive with their lights on. */
export function wantsHeadlights({ light, visibility }: Environment): boolean {
  return light === 'dusk' || visibility <= FOGGY_M;
}

/** The lights of all vehicles of a scene. */
export class Headlights {
  /** Whether they are on. */
  on = false;
  #three;
  #group;
  #parts: SeenInstances[] = []; // lamps, glow and light on the road
  #materials: MeshBasicMaterial[] = [];
  // Light on the road in this picture that is not submitted yet.
  #beams: { matrix: Matrix4; own: boolean }[] = [];
  #visibility = Infinity;
  #strength = 0;
  #color;
  #matrix;
  #step;
  #vector;

  constructor(three: Three, group: Group) {
    this.#three = three;
    this.#group = group;
    this.#color = new three.Color();
    this.#matrix = new three.Matrix4();
    this.#step = new three.Matrix4();
    this.#vector = new three.Vector3();
  }

  /** @param count of vehicles that may have them */
  load(environment: Environment, count: number) {
    this.dispose();
    this.on = wantsHeadlights(environment);
    if (!this.on) {
      return;
    }
    this.#visibility = environment.visibility;
    this.#strength = BEAM_STRENGTH[environment.light];
    const most = Math.max(count, 1);
    const parts = [lampPart(this.#three), glowPart(this.#three), beamPart(this.#three)];
    const plain = parts.map(mergeable);
    this.#materials = [...parts, ...plain].map(
      ({ material }) => material as MeshBasicMaterial);
    this.#parts = parts.map((part, i) => new SeenInstances(this.#three,
      { near: [part], far: [plain[i]], sooner: 0 }, i < 2 ? 4 * most : most));
    const [, glow, beams] = this.#parts;
    // The light lies on road and markings; the glow is in front of everything but glass.
    beams.meshes.forEach((mesh) => { mesh.renderOrder = 4; });
    glow.meshes.forEach((mesh) => { mesh.renderOrder = 1001; });
    this.#group.add(...this.#parts.flatMap(({ meshes }) => meshes));
  }

  /** Remove all lights, before they are added anew. */
  clear() {
    this.#parts.forEach((part) => part.clear());
    this.#beams = [];
  }

  /** @param sight of the camera that draws next */
  see(sight: Sight) {
    this.#shareBeams();
    this.#parts.forEach((part) => part.see(sight));
  }

  /** Free the memory of the graphics card. */
  dispose() {
    this.#parts.forEach((part) => part.dispose());
    disposeOf(this.#materials);
    this.#parts = [];
    this.#materials = [];
  }

  /**
   * @param place of the vehicle's middle on the road
   * @param scale of the body
   * @param distance from the eye [m]
   * @param own whether it is the vehicle in which the camera may be
   */
  add(place: Matrix4, { front, rear, size: [width, height] }: NonNullable<Body['lamps']>,
    [sx, sy, sz]: Scale, distance: number, own: boolean) {
    const [lamps, glow] = this.#parts;
    const seen = Math.min(GLOW_BRIGHTNESS * contrastLeft(distance, this.#visibility), 1);
    for (const [at, way, color, look] of [
      [front, 1, FRONT, GLOW.front], [rear, -1, REAR, GLOW.rear]] as const) {
      for (const side of [1, -1]) {
        const [x, y, z] = [at[0] * sx, side * at[1] * sy, at[2] * sz];
        lamps.add(this.#at(place, x + way * 0.03, y, z, 0)
          .scale(this.#vector.set(0.03, 0.8 * width * sy, 0.8 * height * sz)),
        this.#color.setHex(color), own);
        glow.add(this.#at(place, x + way * 0.08, y, z, way < 0 ? Math.PI : 0)
          .scale(this.#vector.set(1, look.size_m, look.size_m)),
        this.#color.setHex(look.color).multiplyScalar(seen), own);
      }
    }
    if (own || distance < BEAM_SEEN_M) {
      this.#beams.push({ own,
        matrix: this.#at(place, front[0] * sx, 0, BEAM.above, 0).clone() });
    }
  }

  #shareBeams() {
    const beams = this.#beams;
    for (const { matrix: { elements: e }, own, matrix } of beams) {
      const near = beams.filter(({ matrix: { elements: other } }) => (
        Math.hypot(other[12] - e[12], other[13] - e[13]) < SHARED_M)).length;
      const share = this.#strength / (own ? 1 : near);
      // The light is visible from inside the vehicle, too.
      this.#parts[2].add(matrix,
        this.#color.setRGB(share, share, share, this.#three.SRGBColorSpace), false);
    }
    this.#beams = [];
  }

  /** Return the same one each time; `turned` by [rad]. */
  #at(place: Matrix4, x: number, y: number, z: number, turned: number): Matrix4 {
    this.#matrix.copy(place).multiply(this.#step.makeTranslation(x, y, z));
    return turned === 0 ? this.#matrix
      : this.#matrix.multiply(this.#step.makeRotationZ(turned));
  }
}

/** @returns glow around a lamp, seen from ahead; fog dims its colour */
function glowPart(three: Three): Part {
  const map = grey(three, GLOW_TEXELS, GLOW_TEXELS, (u, v) => {
    const away = Math.hypot(2 * u - 1, 2 * v - 1);
    return 0.85 * Math.max(1 - away, 0) ** 3;
  });
  return { geometry: new three.PlaneGeometry(1, 1).rotateX(Math.PI / 2).rotateZ(Math.PI / 2),
    tinted: true, material: new three.MeshBasicMaterial({ map, transparent: true, fog: false,
      toneMapped: false, depthWrite: false, blending: three.AdditiveBlending }) };
}

/** @returns the light on the road, which brightens the surface, paint more than asphalt */
function beamPart(three: Three): Part {
  const { from, to, wide, near, texels } = BEAM;
  const map = grey(three, texels, texels / 2, (u, v) => {
    const ahead = from + u * (to - from);
    const aside = (v - 0.5) * wide;
    const spread = 1.6 + 0.11 * ahead;
    const along = Math.min((ahead - from) / (near - from), 1) * Math.max(1 - u, 0) ** 0.8;
    // Fades to nothing at the edges of the patch.
    const edge = Math.min(2 - Math.abs(4 * v - 2), 1);
    return along * Math.max(edge, 0) * Math.exp(-0.5 * (aside / spread) ** 2);
  });
  const geometry = new three.PlaneGeometry(to - from, wide)
    .translate(from + 0.5 * (to - from), 0, 0);
  return { geometry, tinted: true, material: new three.MeshBasicMaterial({ map, fog: false,
    toneMapped: false, transparent: true, depthWrite: false, polygonOffset: true,
    polygonOffsetFactor: -3, polygonOffsetUnits: -3, blending: three.CustomBlending,
    blendEquation: three.AddEquation, blendSrc: three.DstColorFactor,
    blendDst: three.OneFactor }) };
}

/**
 * @param width [texels]
 * @param height [texels]
 * @param shade 0 to 1, as on the screen, for places of 0 to 1
 */
function grey(three: Three, width: number, height: number,
  shade: (u: number, v: number) => number) {
  const data = new Uint8Array(4 * width * height);
  for (let i = 0; i < width * height; i += 1) {
    const value = 255 * shade((i % width + 0.5) / width,
      (Math.floor(i / width) + 0.5) / height);
    data.set([value, value, value, 255], 4 * i);
  }
  const texture = new three.DataTexture(data, width, height);
  texture.colorSpace = three.SRGBColorSpace;
  texture.magFilter = three.LinearFilter;
  texture.needsUpdate = true;
  return texture;
}
