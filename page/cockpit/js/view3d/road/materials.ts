// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Materials and textures that roads, ground and scenery share. */

import { randomFrom } from './random.js';

import type { BufferGeometry, DataTexture, Material, MeshLambertMaterial } from 'three';
import type { MeshParts } from './mesh_parts.js';
import type { Three } from '../three.js';

const GRAIN_PX = 256;
/** The edge of the grain's square on the road [m]. */
const GRAIN_M = 6;
// Offset of one rank in normalised depth: some 30 steps of a buffer of 24 bits, and at 100 m,
// seen from a car, 3 mm of height.
const RANK_DEPTH = 4e-6;

/** Anisotropy of the grain in fine pictures; it is the most expensive part for a processor. */
export const GRAIN_ANISOTROPY = 8;

/**
 * Return a grain as of asphalt, whose motion conveys speed.
 * @returns grey, repeated, never darker than two thirds
 */
export function grainTexture(three: Three): DataTexture {
  const random = randomFrom('grain');
  const pixels = new Uint8Array(4 * GRAIN_PX * GRAIN_PX);
  const coarse = Array.from({ length: 64 * 64 }, random);
  for (let i = 0; i < GRAIN_PX * GRAIN_PX; i += 1) {
    const patch = coarse[((i / GRAIN_PX) >> 2) * 64 + ((i % GRAIN_PX) >> 2)];
    const grey = 255 - 42 * random() - 34 * patch ** 3;
    pixels.set([grey, grey, grey, 255], 4 * i);
  }
  const texture = new three.DataTexture(pixels, GRAIN_PX, GRAIN_PX);
  texture.wrapS = three.RepeatWrapping;
  texture.wrapT = three.RepeatWrapping;
  texture.magFilter = three.LinearFilter;
  texture.minFilter = three.LinearMipmapLinearFilter;
  texture.generateMipmaps = true;
  texture.anisotropy = GRAIN_ANISOTROPY;
  texture.needsUpdate = true;
  return texture;
}

/**
 * Make ranks decide which of two flat things at one height is visible.
 * @param material of meshes with an attribute `rank`
 */
function ranked<M extends Material>(material: M): M {
  material.onBeforeCompile = (shader) => {
    shader.vertexShader = `attribute float rank;\n${shader.vertexShader}`.replace(
      '#include <project_vertex>',
      `#include <project_vertex>
      gl_Position.z -= rank * ${RANK_DEPTH} * gl_Position.w;`);
  };
  material.customProgramCacheKey = () => 'ranked';
  return material;
}

/** Return the material of everything that is coloured by its vertices. */
export function paintedMaterial(three: Three, map: DataTexture | null): MeshLambertMaterial {
  return ranked(new three.MeshLambertMaterial({ vertexColors: true, map }));
}

export function geometryOf(three: Three,
  { positions, normals, colors, ranks, indices }: MeshParts): BufferGeometry {
  const geometry = new three.BufferGeometry();
  const linear = new Float32Array(colors.length);
  for (let i = 0; i < colors.length; i += 1) {
    linear[i] = LINEAR[Math.round(colors[i])];
  }
  const uv = new Float32Array(2 * ranks.length);
  for (let i = 0; i < ranks.length; i += 1) {
    uv[2 * i] = positions[3 * i] / GRAIN_M;
    uv[2 * i + 1] = positions[3 * i + 1] / GRAIN_M;
  }
  geometry.setAttribute('position', new three.Float32BufferAttribute(positions, 3));
  geometry.setAttribute('normal', new three.Float32BufferAttribute(normals, 3));
  geometry.setAttribute('color', new three.BufferAttribute(linear, 3));
  geometry.setAttribute('uv', new three.BufferAttribute(uv, 2));
  geometry.setAttribute('rank', new three.Float32BufferAttribute(ranks, 1));
  geometry.setIndex(indices);
  return geometry;
}

// three.js computes with linear light, while sRGB is not linear (IEC 61966-2-1).
const LINEAR = Float32Array.from({ length: 256 }, (_, byte) => {
  const value = byte / 255;
  return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
});
