// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Motor vehicles with few triangles, for use where they are small in the picture. */

import { MeshBuilder } from './mesh_builder.js';
import { GLASS, HEADLIGHT, LENS, PAINT, TRIM } from './motor_vehicles.js';

import type { Point, Tint } from './mesh_builder.js';
import type { Body } from './motor_vehicles.js';

const LOAD: Tint = [0.9, 0.9, 0.88];
const WHEEL_CORNERS = 6;

/** Sections across a vehicle as shares of its half length, half width and height. */
export type Row = [x: number, half: number, sill: number, belt: number, top: number, roof: number];

const SKINS: Record<string, { rows: Row[]; glass: number[]; windows: number[] } | undefined> = {
  car: { rows: [[-1, 0.93, 0.24, 0.57, 0.6, 0.73], [-0.76, 1, 0.15, 0.66, 0.71, 0.76],
    [-0.46, 1, 0.14, 0.66, 0.96, 0.65], [0.11, 1, 0.13, 0.65, 0.97, 0.65],
    [0.46, 1, 0.13, 0.64, 0.69, 0.76], [1, 0.82, 0.18, 0.42, 0.46, 0.64]],
  glass: [1, 3], windows: [1, 2, 3] },
  van: { rows: [[-1, 0.98, 0.15, 0.52, 0.98, 0.86], [0.3, 1, 0.12, 0.53, 0.98, 0.87],
    [0.7, 1, 0.12, 0.51, 0.6, 0.84], [1, 0.88, 0.14, 0.38, 0.42, 0.73]],
  glass: [1], windows: [1] },
};

/**
 * Make the plain shape of a body, with the same size and places of windows, wheels and lamps.
 * @param key of its appearance, which begins with its kind
 * @returns null if it has few triangles anyway
 */
export function plainBody(key: string, body: Body): MeshBuilder | null {
  const [kind] = key.split(' ');
  const { length, width, height } = body;
  const [l, w] = [length / 2, width / 2];
  const skin = SKINS[kind];
  const mesh = new MeshBuilder();
  if (skin !== undefined) {
    addSkin(mesh, skin, l, w, height);
  } else if (kind === 'truck') {
    mesh.box([-l, -w, 1.05], [l - 2.45, w, height], LOAD)
      .box([-l + 0.2, -0.42, 0.65], [l - 1.6, 0.42, 1.05], TRIM)
      .box([l - 2.1, -w, 0.45], [l, w, 1.6], PAINT)
      .box([l - 2.1, -0.98 * w, 1.6], [l, 0.98 * w, 2.5], GLASS, { x: 0.09, y: 0.04 })
      .box([l - 2.1, -0.94 * w, 2.5], [l - 0.1, 0.94 * w, 2.95], PAINT);
  } else if (kind === 'bus') {
    mesh.box([-l, -w, 0.35], [l, w, 1.15], PAINT)
      .box([-l, -w, 1.15], [l, w, 2.65], GLASS)
      .box([-l, -0.97 * w, 2.65], [l, 0.97 * w, height], PAINT);
  } else {
    return null;
  }
  addWheels(mesh, body);
  addLamps(mesh, body);
  return mesh;
}

/** `l`: half length [m]; `w`: half width [m]; `height` [m]. */
function addSkin(mesh: MeshBuilder, { rows, glass, windows }: NonNullable<typeof SKINS[string]>,
  l: number, w: number, height: number) {
  const sections = rows.map(([x, half, sill, belt, top, roof]) => {
    const left: Point[] = [[x * l, roof * w, top * height], [x * l, half * w, belt * height],
      [x * l, 0.97 * half * w, sill * height]];
    return [...left.map(([u, v, z]) => [u, -v, z] as Point).reverse(), ...left];
  });
  mesh.skin(sections, (i, j) => ((j === 2 && glass.includes(i))
    || ((j === 1 || j === 3) && windows.includes(i)) ? GLASS : PAINT));
  mesh.polygon(sections[0], PAINT).polygon(sections[sections.length - 1].toReversed(), PAINT);
}

/** Dark sides of the wheels, a little before the flanks. */
function addWheels(mesh: MeshBuilder, { wheels, width }: Body) {
  if (wheels === null) {
    return;
  }
  const half = width / 2 + 0.012;
  for (const x of [wheels.front, wheels.rear]) {
    for (const side of [1, -1]) {
      mesh.polygon(Array.from({ length: WHEEL_CORNERS }, (_, i) => {
        const angle = -side * 2 * Math.PI * (i + 0.5) / WHEEL_CORNERS;
        return [x + wheels.radius * 1.08 * Math.cos(angle), side * half,
          wheels.radius * (1.02 + 1.02 * Math.sin(angle))];
      }), TRIM);
    }
  }
}

function addLamps(mesh: MeshBuilder, { lamps }: Body) {
  if (lamps === null) {
    return;
  }
  const { front, rear, size: [width, height] } = lamps;
  for (const side of [1, -1]) {
    const both: [Point, number, Tint][] = [[front, 0.06, HEADLIGHT], [rear, -0.04, LENS]];
    for (const [[x, y, z], off, tint] of both) {
      const [u0, u1] = [side * y - width / 2, side * y + width / 2];
      const corners: Point[] = [[x + off, u0, z - height / 2],
        [x + off, u1, z - height / 2], [x + off, u1, z + height / 2],
        [x + off, u0, z + height / 2]];
      mesh.polygon(off > 0 ? corners : corners.reverse(), tint);
    }
  }
}
