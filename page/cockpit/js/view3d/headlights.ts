// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Headlights and tail lamps at dusk and in fog: lamps, their glow, and the light on the road. */

import { contrastLeft } from './road/fog.js';
import { mergeable, SeenInstances } from './seen_instances.js';

/** @import { Group, Matrix4, MeshBasicMaterial } from 'three' */
/** @import { Environment } from '../messages.js' */
/** @import { Body } from './bodies/motor_vehicles.js' */
/** @import { Scale } from './fitted_parts.js' */
/** @import { Three } from './road/road_world.js' */
/** @import { Part, Sight } from './seen_instances.js' */

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

/**
 * Return whether people drive with their lights on.
 *
 * @param {Environment} environment
 * @returns {boolean}
 */
export function wantsHeadlights({ light, visibility }) {
  return light === 'dusk' || visibility <= FOGGY_M;
}

/** The lights of all vehicles of a scene. */
export class Headlights {
  /** Whether they are on. */
  on = false;
  #three;
  #group;
  /** @type {SeenInstances[]} lamps, glow and light on the road */
  #parts = [];
  /** @type {MeshBasicMaterial[]} */
  #materials = [];
  // Light on the road in this picture that is not submitted yet.
  /** @type {{matrix: Matrix4, own: boolean}[]} */
  #beams = [];
  #visibility = Infinity;
  #strength = 0;
  #color;
  #matrix;
  #step;
  #vector;

  /**
   * @param {Three} three
   * @param {Group} group
   */
  constructor(three, group) {
    this.#three = three;
    this.#group = group;
    this.#color = new three.Color();
    this.#matrix = new three.Matrix4();
    this.#step = new three.Matrix4();
    this.#vector = new three.Vector3();
  }

  /**
   * @param {Environment} environment
   * @param {number} count of vehicles that may have them
   */
  load(environment, count) {
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
      ({ material }) => /** @type {MeshBasicMaterial} */ (material));
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

  /** @param {Sight} sight of the camera that draws next */
  see(sight) {
    this.#shareBeams();
    this.#parts.forEach((part) => part.see(sight));
  }

  /** Free the memory of the graphics card. */
  dispose() {
    this.#parts.forEach((part) => part.dispose());
    this.#materials.forEach((material) => {
      material.map?.dispose();
      material.dispose();
    });
    this.#parts = [];
    this.#materials = [];
  }

  /**
   * @param {Matrix4} place of the vehicle's middle on the road
   * @param {NonNullable<Body['lamps']>} lamps
   * @param {Scale} scale of the body
   * @param {number} distance from the eye [m]
   * @param {boolean} own whether it is the vehicle in which the camera may be
   */
  add(place, { front, rear, size: [width, height] }, [sx, sy, sz], distance, own) {
    const [lamps, glow] = this.#parts;
    const seen = Math.min(GLOW_BRIGHTNESS * contrastLeft(distance, this.#visibility), 1);
    for (const [at, way, color, look] of /** @type {const} */ ([
      [front, 1, FRONT, GLOW.front], [rear, -1, REAR, GLOW.rear]])) {
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

  /**
   * @param {Matrix4} place
   * @param {number} x
   * @param {number} y
   * @param {number} z
   * @param {number} turned [rad]
   * @returns {Matrix4} the same one each time
   */
  #at(place, x, y, z, turned) {
    this.#matrix.copy(place).multiply(this.#step.makeTranslation(x, y, z));
    return turned === 0 ? this.#matrix
      : this.#matrix.multiply(this.#step.makeRotationZ(turned));
  }
}

/**
 * @param {Three} three
 * @returns {Part} lamps that shine
 */
function lampPart(three) {
  return { geometry: new three.BoxGeometry(1, 1, 1), tinted: true,
    material: new three.MeshBasicMaterial({ toneMapped: false }) };
}

/**
 * @param {Three} three
 * @returns {Part} glow around a lamp, seen from ahead; fog dims its colour
 */
function glowPart(three) {
  const map = grey(three, GLOW_TEXELS, GLOW_TEXELS, (u, v) => {
    const away = Math.hypot(2 * u - 1, 2 * v - 1);
    return 0.85 * Math.max(1 - away, 0) ** 3;
  });
  return { geometry: new three.PlaneGeometry(1, 1).rotateX(Math.PI / 2).rotateZ(Math.PI / 2),
    tinted: true, material: new three.MeshBasicMaterial({ map, transparent: true, fog: false,
      toneMapped: false, depthWrite: false, blending: three.AdditiveBlending }) };
}

/**
 * @param {Three} three
 * @returns {Part} the light on the road, which brightens the surface, paint more than
 *   asphalt
 */
function beamPart(three) {
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
 * @param {Three} three
 * @param {number} width [texels]
 * @param {number} height [texels]
 * @param {(u: number, v: number) => number} shade 0 to 1, as on the screen, for
 *   places of 0 to 1
 */
function grey(three, width, height, shade) {
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
