// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Light and air: the sky, the sun and the fog. */

import { DEGREE } from '../../units.js';
import { airFog, extinction, fogAsAirDoes } from './fog.js';

import type { BufferGeometry, Group, Mesh, ShaderMaterial } from 'three';
import type { Environment } from '../../messages.js';
import type { Three } from '../three.js';

export type Sky = Mesh<BufferGeometry, ShaderMaterial>;

// The sky is seen through a layer of haze of this height [m].
const HAZE_M = 250;

/** The look of a time of day; colours as on the screen. */
export interface Daylight {
  zenith: number;
  horizon: number; // on a clear day
  fog: number;
  sun: number;
  sun_light: number;
  sun_from: [number, number, number];
  ground: number; // light that it reflects
  sky_light: number;
}

const LIGHTS: Record<Environment['light'], Daylight> = {
  day: { zenith: 0x4f86c6, horizon: 0xc9dbe8, fog: 0xc4c9cb, sun: 0xfff4e0, sun_light: 1.9,
    sun_from: [-0.45, -0.6, 0.75], ground: 0x9a9c88, sky_light: 2.0 },
  dusk: { zenith: 0x34466e, horizon: 0xc9ab97, fog: 0x565b66, sun: 0xffa66a, sun_light: 0.5,
    sun_from: [-0.9, 0.35, 0.09], ground: 0x4c4a48, sky_light: 0.95 },
};

const SKY_TONE = `
uniform vec3 zenith, horizon, fogTone, sunTone, sunFrom;
uniform float haze;
vec3 skyTone(vec3 toward) {
  float up = max(toward.z, 0.0);
  vec3 tone = mix(horizon, zenith, pow(up, 0.55));
  float near = max(dot(toward, sunFrom), 0.0);
  tone += sunTone * (0.16 * pow(near, 12.0) + 4.0 * smoothstep(0.99955, 0.9998, near));
  return mix(fogTone, tone, exp(-haze / max(up, 0.004)));
}`;
// At the far plane, whatever the camera's place and range.
const SKY_PLACE = `
  gl_Position = (projectionMatrix * mat4(mat3(viewMatrix)) * vec4(position, 1.0)).xyww;`;
const SKY_VERTEX = `
varying vec3 vToward;
void main() {
  vToward = position;
  ${SKY_PLACE}
}`;
const SKY_FRAGMENT = `
${SKY_TONE}
varying vec3 vToward;
void main() {
  gl_FragColor = vec4(skyTone(normalize(vToward)), 1.0);
  #include <tonemapping_fragment>
  #include <colorspace_fragment>
}`;
// The same at vertices, interpolated between them: a fraction of the time on a processor.
const PLAIN_VERTEX = `
${SKY_TONE}
uniform float encoded;
varying vec3 vTone;
void main() {
  vec3 tone = skyTone(position);
  vTone = mix(tone, 1.055 * pow(tone, vec3(1.0 / 2.4)) - 0.055, encoded);
  ${SKY_PLACE}
}`;
const PLAIN_FRAGMENT = `
varying vec3 vTone;
void main() {
  gl_FragColor = vec4(vTone, 1.0);
}`;
// Elevations of the plain sky's vertices: it changes most near the horizon [deg].
const RINGS_DEG = [-90, -1, 0, 0.4, 0.9, 1.8, 3.2, 5.5, 9, 14, 22, 34, 50, 70, 90];
const AROUND = 24;

/** The sky of a scene, its lights, and the fog for the scene of three.js. */
export class Atmosphere {
  group: Group;
  #three;
  #sky;
  #plainSky;
  #sun;
  #ambient;
  /** The fog of every material. */
  fog;

  constructor(three: Three) {
    fogAsAirDoes(three);
    this.#three = three;
    this.fog = airFog(three);
    this.group = new three.Group();
    const color = () => ({ value: new three.Color() });
    const uniforms = { zenith: color(), horizon: color(), fogTone: color(), sunTone: color(),
      sunFrom: { value: new three.Vector3() }, haze: { value: 0 }, encoded: { value: 0 } };
    const sky = (geometry: BufferGeometry, vertexShader: string, fragmentShader: string): Sky => {
      const mesh = new three.Mesh(geometry, new three.ShaderMaterial({ vertexShader,
        fragmentShader, side: three.DoubleSide, depthWrite: false, uniforms }));
      mesh.frustumCulled = false;
      // Drawn last, so that parts hidden by roads are not computed.
      mesh.renderOrder = 1000;
      return mesh;
    };
    this.#sky = sky(new three.IcosahedronGeometry(1, 3), SKY_VERTEX, SKY_FRAGMENT);
    this.#plainSky = sky(ringed(three), PLAIN_VERTEX, PLAIN_FRAGMENT);
    this.#plainSky.onBeforeRender = (renderer) => {
      // A mirror's picture holds linear light, the screen's holds sRGB.
      uniforms.encoded.value = renderer.getRenderTarget() === null ? 1 : 0;
      this.#plainSky.material.uniformsNeedUpdate = true;
    };
    this.setFine(true);
    this.#sun = new three.DirectionalLight();
    this.#ambient = new three.HemisphereLight();
    this.group.add(this.#sky, this.#plainSky, this.#sun, this.#sun.target, this.#ambient);
  }

  get triangles() {
    return this.#sky.geometry.attributes.position.count / 3;
  }

  /** @param fine whether each pixel of the sky is computed, with the sun in it */
  setFine(fine: boolean) {
    this.#sky.visible = fine;
    this.#plainSky.visible = !fine;
  }

  /** Show a time of day and a visibility. */
  set({ light, visibility }: Environment) {
    const { Color } = this.#three;
    const look = LIGHTS[light];
    const haze = extinction(visibility) * HAZE_M;
    const clear = Math.exp(-4 * haze);
    const fog = new Color(look.fog).lerp(new Color(look.horizon), clear);
    const { uniforms } = this.#sky.material;
    uniforms.zenith.value.set(look.zenith);
    uniforms.horizon.value.set(look.horizon);
    uniforms.sunTone.value.set(look.sun);
    uniforms.sunFrom.value.set(...look.sun_from).normalize();
    uniforms.fogTone.value.copy(fog);
    uniforms.haze.value = haze;
    this.fog.color.copy(fog);
    this.fog.density = extinction(visibility);
    this.#sun.color.set(look.sun);
    this.#sun.position.set(...look.sun_from);
    // The sunlight that fog scatters comes from all directions.
    this.#sun.intensity = look.sun_light * clear;
    this.#ambient.color.set(0xffffff).lerp(new Color(look.zenith), 0.18);
    this.#ambient.groundColor.set(look.ground);
    this.#ambient.intensity = look.sky_light + 0.4 * look.sun_light * (1 - clear);
  }

  /** Free the memory of the graphics card. */
  dispose() {
    for (const { geometry, material } of [this.#sky, this.#plainSky]) {
      geometry.dispose();
      material.dispose();
    }
    this.#sun.dispose();
  }
}

/** @returns a ball of radius 1 around the upward axis */
function ringed(three: Three): BufferGeometry {
  const positions = [];
  const indices = [];
  for (const [ring, height] of RINGS_DEG.entries()) {
    for (let i = 0; i <= AROUND; i += 1) {
      const [up, around] = [height * DEGREE, 2 * Math.PI * i / AROUND];
      positions.push(Math.cos(up) * Math.cos(around), Math.cos(up) * Math.sin(around),
        Math.sin(up));
      const last = ring * (AROUND + 1) + i;
      if (ring > 0 && i > 0) {
        const below = last - AROUND - 1;
        indices.push(below - 1, below, last, below - 1, last, last - 1);
      }
    }
  }
  const geometry = new three.BufferGeometry();
  geometry.setAttribute('position', new three.Float32BufferAttribute(positions, 3));
  geometry.setIndex(indices);
  return geometry;
}
