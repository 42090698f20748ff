// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Bodies of two-wheelers, people and things: x ahead, y left, z up, around their middle. */

import { MeshBuilder } from './mesh_builder.js';
import { PAINT } from './motor_vehicles.js';

import type { Body } from './motor_vehicles.js';
import type { Point, Tint } from './mesh_builder.js';

const DARK: Tint = [0.06, 0.06, 0.07];
const METAL: Tint = [0.45, 0.46, 0.48];
const SKIN: Tint = [0.75, 0.55, 0.42];
const CLOTH: Tint = [0.1, 0.13, 0.2];
const SIDES = 10;

export function bicycle(): Body {
  const mesh = new MeshBuilder()
    .box([-0.5, -0.02, 0.5], [0.45, 0.02, 0.56], METAL)
    .box([-0.22, -0.02, 0.3], [-0.16, 0.02, 0.95], METAL)
    .box([0.42, -0.02, 0.34], [0.47, 0.02, 1.02], METAL)
    .box([0.38, -0.28, 0.99], [0.42, 0.28, 1.03], DARK)
    .box([-0.33, -0.09, 0.92], [-0.07, 0.09, 0.99], DARK);
  rider(mesh, -0.18, 0.96, 0.35);
  return { mesh, length: 1.8, width: 0.6, height: 1.8, lamps: null,
    wheels: { front: 0.52, rear: -0.52, track: 0.03, radius: 0.34, width: 0.04 } };
}

export function motorcycle(): Body {
  const mesh = new MeshBuilder()
    .box([-0.55, -0.17, 0.42], [0.35, 0.17, 0.72], DARK, { x: 0.05, y: 0.03 })
    .box([-0.05, -0.17, 0.7], [0.45, 0.17, 0.95], PAINT, { x: 0.12, y: 0.06 })
    .box([-0.85, -0.15, 0.72], [-0.05, 0.15, 0.86], DARK, { x: 0.06, y: 0.03 })
    .box([0.45, -0.2, 0.8], [0.7, 0.2, 1.12], PAINT, { x: 0.1, y: 0.07 })
    .box([0.36, -0.36, 1.02], [0.42, 0.36, 1.07], DARK);
  rider(mesh, -0.3, 0.86, 0.42);
  return { mesh, length: 2.1, width: 0.8, height: 1.65,
    wheels: { front: 0.7, rear: -0.68, track: 0.16, radius: 0.31, width: 0.16 },
    lamps: { front: [0.7, 0.04, 0.93], rear: [-0.86, 0.05, 0.8], size: [0.1, 0.1] } };
}

export function pedestrian(): Body {
  const mesh = new MeshBuilder();
  for (const side of [-1, 1]) {
    mesh.cylinder([0.04 * side, 0.1 * side, 0.42], 'z', 0.84, 0.085, CLOTH, CLOTH, SIDES)
      .cylinder([-0.03 * side, 0.25 * side, 1.1], 'z', 0.6, 0.055, PAINT, PAINT, SIDES)
      .box([-0.06 + 0.04 * side, 0.1 * side - 0.05, 0], [0.18 + 0.04 * side, 0.1 * side + 0.05,
        0.08], DARK);
  }
  mesh.box([-0.12, -0.2, 0.82], [0.12, 0.2, 1.45], PAINT, { x: 0.02, y: 0.03 })
    .cylinder([0, 0, 1.5], 'z', 0.14, 0.06, SKIN, SKIN, SIDES);
  ball(mesh, [0.01, 0, 1.65], 0.125, SKIN);
  return { mesh, length: 0.5, width: 0.6, height: 1.78, wheels: null, lamps: null };
}

/**
 * A thing of which only the outline is known.
 * @param vertices of its outline, flat, either way around [m]
 * @param height [m]
 */
export function prism(vertices: number[], height: number): Body {
  const low: Point[] = [];
  let twiceArea = 0;
  for (let i = 0; i < vertices.length; i += 2) {
    const next = (i + 2) % vertices.length;
    twiceArea += vertices[i] * vertices[next + 1] - vertices[next] * vertices[i + 1];
    low.push([vertices[i], vertices[i + 1], 0]);
  }
  if (twiceArea < 0) {
    low.reverse();
  }
  const high: Point[] = low.map(([x, y]) => [x, y, height]);
  const mesh = new MeshBuilder().polygon(high, PAINT).sides(low, high, PAINT);
  // Stripes all around, as on a road barrier.
  const middle = 0.62 * height;
  const ring = (z: number) => low.map(([x, y]): Point => [1.004 * x, 1.004 * y, z]);
  mesh.sides(ring(middle), ring(middle + 0.18 * height), [0.95, 0.95, 0.95]);
  const xs = vertices.filter((_, i) => i % 2 === 0);
  const ys = vertices.filter((_, i) => i % 2 === 1);
  return { mesh, length: Math.max(...xs) - Math.min(...xs),
    width: Math.max(...ys) - Math.min(...ys), height, wheels: null, lamps: null };
}

/** `x` of the seat [m]; `z` of the seat [m]; `lean`: how far the shoulders are ahead [m]. */
function rider(mesh: MeshBuilder, x: number, z: number, lean: number) {
  const section = (at: number, half: number, height: number): Point[] => [
    [at + 0.1, -half, height], [at + 0.1, half, height], [at - 0.1, half, height],
    [at - 0.1, -half, height]];
  const hip = section(x, 0.16, z);
  const chest = section(x + lean, 0.21, z + 0.52);
  mesh.sides(hip, chest, PAINT).polygon(chest, PAINT);
  for (const side of [-1, 1]) {
    mesh.box([x - 0.05, side * 0.13 - 0.06, 0.35], [x + 0.35, side * 0.13 + 0.06, z + 0.06], CLOTH,
      { x: 0.1, y: 0 })
      .box([x + lean, side * 0.22 - 0.045, z + 0.1], [x + lean + 0.4, side * 0.22 + 0.045,
        z + 0.26], PAINT);
  }
  ball(mesh, [x + lean + 0.06, 0, z + 0.72], 0.14, DARK);
}

/** @param radius [m] */
function ball(mesh: MeshBuilder, [x, y, z]: Point, radius: number, tint: Tint) {
  const rings = 5;
  const at = (ring: number, i: number): Point => {
    const up = -Math.PI / 2 + (Math.PI * ring) / rings;
    const around = (2 * Math.PI * i) / SIDES;
    return [x + radius * Math.cos(up) * Math.cos(around),
      y + radius * Math.cos(up) * Math.sin(around), z + radius * Math.sin(up)];
  };
  for (let ring = 0; ring < rings; ring += 1) {
    for (let i = 0; i < SIDES; i += 1) {
      mesh.polygon([at(ring, i), at(ring, i + 1), at(ring + 1, i + 1), at(ring + 1, i)], tint);
    }
  }
}
