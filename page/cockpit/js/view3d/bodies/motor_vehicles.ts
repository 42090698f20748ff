// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Bodies of cars, vans, trucks and buses: x ahead, y left, z up, around their middle. */

import { MeshBuilder } from './mesh_builder.js';

import type { Point, Tint } from './mesh_builder.js';

/** A body of a given size, with the places of its wheels and lamps. */
export interface Body {
  mesh: MeshBuilder; // around its middle, at size `length` by `width` by `height`
  length: number; // [m]
  width: number; // [m]
  height: number; // [m]
  // axles ahead of the middle, distance of the tyres' outer faces, their size [m]
  wheels: { front: number; rear: number; track: number; radius: number; width: number } | null;
  // the left ones; the right ones mirror them [m]
  lamps: { front: Point; rear: Point; size: [width: number, height: number] } | null;
}

export interface Axles { front: number; rear: number } // ahead of the middle [m]

export const PAINT: Tint = [1, 1, 1, true];
export const GLASS: Tint = [0.07, 0.09, 0.12];
export const TRIM: Tint = [0.05, 0.05, 0.06];
export const HEADLIGHT: Tint = [1.5, 1.5, 1.4];
export const LENS: Tint = [0.35, 0.03, 0.03];
const PLATE: Tint = [1.3, 1.3, 1.25];

/** A section across a car: half widths and heights. */
export interface Section {
  x: number; // ahead of the middle [m]
  half: number; // of the flank's width [m]
  sill: number; // [m]
  belt: number; // lower edge of the windows, or the bonnet's edge [m]
  top: number; // [m]
  roof: number; // half width of the roof, or where the bonnet's crown begins [m]
}

/** @returns from the right sill over the roof to the left one */
function outline({ x, half, sill, belt, top, roof }: Section): Point[] {
  const middle = sill + 0.52 * (belt - sill);
  const left: [number, number][] = [[0, top + 0.02], [0.82 * roof, top], [roof, top - 0.05],
    [half * 0.97, belt], [half, middle], [half * 0.96, sill]];
  const points: Point[] = left.slice(1).reverse().map(([y, z]) => [x, -y, z]);
  return [...points, ...left.map(([y, z]): Point => [x, y, z])];
}

/** A saloon of five seats. */
export function car({ front, rear }: Axles = { front: 1.35, rear: -1.32 }): Body {
  const [length, width, height] = [4.5, 1.8, 1.44];
  const l = length / 2;
  const w = width / 2;
  const sections: Section[] = [
    { x: -l, half: 0.9 * w, sill: 0.4, belt: 0.82, top: 0.86, roof: 0.72 * w },
    { x: -l + 0.14, half: 0.97 * w, sill: 0.24, belt: 0.93, top: 1.0, roof: 0.76 * w },
    { x: -l + 0.55, half: w, sill: 0.22, belt: 0.95, top: 1.03, roof: 0.76 * w },
    { x: -l + 1.15, half: w, sill: 0.2, belt: 0.95, top: height - 0.06, roof: 0.64 * w },
    { x: -0.35, half: w, sill: 0.19, belt: 0.94, top: height - 0.02, roof: 0.66 * w },
    { x: 0.25, half: w, sill: 0.19, belt: 0.93, top: height - 0.05, roof: 0.65 * w },
    { x: 1.02, half: w, sill: 0.19, belt: 0.92, top: 1.0, roof: 0.76 * w },
    { x: 1.7, half: 0.98 * w, sill: 0.2, belt: 0.8, top: 0.9, roof: 0.74 * w },
    { x: l - 0.1, half: 0.88 * w, sill: 0.22, belt: 0.66, top: 0.74, roof: 0.66 * w },
    { x: l, half: 0.78 * w, sill: 0.3, belt: 0.56, top: 0.6, roof: 0.6 * w },
  ];
  const mesh = new MeshBuilder().skin(sections.map(outline), (i, j) => {
    const isWindow = j === 2 || j === 7;
    const isTop = j > 2 && j < 7;
    // Windows between the pillars; the screens are the slopes of the top.
    return (isWindow && i >= 2 && i <= 5) || (isTop && (i === 2 || i === 5)) ? GLASS
      : (j === 0 || j === 9) && i > 0 ? [0.7, 0.7, 0.7, true] : PAINT;
  });
  ends(mesh, sections);
  mesh.box([-l - 0.01, -0.26, 0.5], [-l + 0.02, 0.26, 0.62], PLATE)
    .box([l - 0.03, -0.5 * w, 0.34], [l + 0.01, 0.5 * w, 0.46], TRIM)
    .box([-l - 0.01, -0.6 * w, 0.32], [-l + 0.06, 0.6 * w, 0.4], TRIM);
  mirrors(mesh, 0.82, w, 0.96);
  const wheels = { front, rear, track: width + 0.02, radius: 0.32, width: 0.21 };
  arches(mesh, wheels, w);
  return { mesh, length, width, height, wheels,
    lamps: { front: [l - 0.07, 0.68 * w, 0.62], rear: [-l, 0.7 * w, 0.74], size: [0.3, 0.14] } };
}

/** A closed van, or a small bus. */
export function van({ front, rear }: Axles = { front: 1.72, rear: -1.6 }): Body {
  const [length, width, height] = [5.4, 2.0, 2.2];
  const l = length / 2;
  const w = width / 2;
  const sections: Section[] = [
    { x: -l, half: 0.97 * w, sill: 0.35, belt: 1.15, top: height - 0.06, roof: 0.86 * w },
    { x: -l + 0.1, half: w, sill: 0.28, belt: 1.18, top: height - 0.02, roof: 0.88 * w },
    { x: 0.7, half: w, sill: 0.26, belt: 1.18, top: height - 0.02, roof: 0.88 * w },
    { x: 1.1, half: w, sill: 0.26, belt: 1.16, top: height - 0.1, roof: 0.86 * w },
    { x: 1.9, half: w, sill: 0.26, belt: 1.12, top: 1.3, roof: 0.84 * w },
    { x: l - 0.12, half: 0.95 * w, sill: 0.27, belt: 0.92, top: 1.02, roof: 0.78 * w },
    { x: l, half: 0.86 * w, sill: 0.34, belt: 0.74, top: 0.8, roof: 0.7 * w },
  ];
  const mesh = new MeshBuilder().skin(sections.map(outline), (i, j) => {
    const isWindow = j === 2 || j === 7;
    const isTop = j > 2 && j < 7;
    return (isWindow && (i === 2 || i === 3)) || (isTop && i === 3) ? GLASS : PAINT;
  });
  ends(mesh, sections);
  mesh.box([-l - 0.01, -0.7 * w, 1.3], [-l + 0.02, 0.7 * w, 1.85], GLASS)
    .box([-l - 0.015, -0.26, 0.6], [-l + 0.02, 0.26, 0.72], PLATE)
    .box([l - 0.03, -0.6 * w, 0.4], [l + 0.01, 0.6 * w, 0.56], TRIM);
  mirrors(mesh, 1.55, w, 1.3);
  const wheels = { front, rear, track: width + 0.02, radius: 0.35, width: 0.23 };
  arches(mesh, wheels, w);
  return { mesh, length, width, height, wheels,
    lamps: { front: [l - 0.06, 0.72 * w, 0.82], rear: [-l, 0.88 * w, 1.0], size: [0.16, 0.34] } };
}

/** A truck with its load in a box. */
export function truck({ front, rear }: Axles = { front: 3.65, rear: -3.1 }): Body {
  const [length, width, height] = [10, 2.5, 3.5];
  const l = length / 2;
  const w = width / 2;
  const cab = l - 2.1;
  const mesh = new MeshBuilder()
    .box([-l, -w, 1.05], [cab - 0.35, w, height], [0.9, 0.9, 0.88])
    .box([-l + 0.2, -0.42, 0.65], [cab + 0.5, 0.42, 1.05], TRIM)
    .box([-l, -w, 0.55], [-l + 0.12, w, 0.7], TRIM)
    .box([cab, -w, 0.45], [l, w, 1.55], PAINT, { x: 0.03, y: 0.02 })
    .box([cab, -0.98 * w, 1.55], [l - 0.02, 0.98 * w, 2.95], PAINT, { x: 0.16, y: 0.08 });
  mesh.polygon([[l - 0.02, -0.86 * w, 1.68], [l - 0.02, 0.86 * w, 1.68],
    [l - 0.115, 0.84 * w, 2.5], [l - 0.115, -0.84 * w, 2.5]], GLASS)
    .box([l - 0.06, -0.8 * w, 0.75], [l + 0.01, 0.8 * w, 1.15], TRIM);
  for (const side of [-1, 1]) {
    const window: Point[] = [[cab + 0.75, side * 1.0 * w, 1.7], [l - 0.35, side * 1.0 * w, 1.7],
      [l - 0.45, side * 0.97 * w, 2.45], [cab + 0.75, side * 0.97 * w, 2.45]];
    mesh.polygon(side < 0 ? window : window.reverse(), GLASS);
  }
  mirrors(mesh, l - 0.4, w, 2.0, 0.4);
  const wheels = { front, rear, track: width, radius: 0.5, width: 0.34 };
  return { mesh, length, width, height, wheels,
    lamps: { front: [l + 0.01, 0.8 * w, 0.62], rear: [-l, 0.8 * w, 0.8], size: [0.34, 0.16] } };
}

export function bus(): Body {
  const [length, width, height] = [12, 2.55, 3.1];
  const l = length / 2;
  const w = width / 2;
  const mesh = new MeshBuilder()
    .box([-l, -w, 0.35], [l, w, 1.15], PAINT)
    .box([-l, -w, 1.15], [l, w, 2.65], GLASS, { y: 0.02 })
    .box([-l, -0.985 * w, 2.65], [l - 0.02, 0.985 * w, height], PAINT, { x: 0.05, y: 0.1 })
    .box([l - 0.02, -0.7 * w, 2.68], [l + 0.01, 0.7 * w, 2.98], TRIM)
    .box([-l - 0.005, -0.99 * w, 1.14], [-l + 0.05, 0.99 * w, 1.7], PAINT);
  for (let x = -l + 1.5; x < l - 1; x += 1.5) {
    mesh.box([x - 0.05, -w - 0.005, 1.14], [x + 0.05, w + 0.005, 2.66], TRIM, { y: 0.02 });
  }
  mirrors(mesh, l + 0.1, w, 2.1, 0.35);
  const wheels = { front: 3.3, rear: -2.7, track: width + 0.02, radius: 0.48, width: 0.3 };
  arches(mesh, wheels, w);
  return { mesh, length, width, height, wheels,
    lamps: { front: [l, 0.78 * w, 0.7], rear: [-l, 0.84 * w, 1.0], size: [0.28, 0.2] } };
}

/** Close a skin at both ends. */
function ends(mesh: MeshBuilder, sections: Section[]) {
  const back = outline(sections[0]);
  const front = outline(sections[sections.length - 1]);
  mesh.polygon(back, PAINT).polygon(front.reverse(), PAINT);
  // The floor, visible only if a vehicle stands higher than the eye.
  const floor = sections.map(({ x, half, sill }) => [x, 0.96 * half, sill]);
  for (let i = 0; i + 1 < floor.length; i += 1) {
    const [x0, y0, z0] = floor[i];
    const [x1, y1, z1] = floor[i + 1];
    mesh.polygon([[x0, y0, z0], [x1, y1, z1], [x1, -y1, z1], [x0, -y0, z0]], TRIM);
  }
}

/** `x` of both [m]; `half`: width of the flank [m]; `z` [m]; `size`: height [m]. */
function mirrors(mesh: MeshBuilder, x: number, half: number, z: number, size = 0.14) {
  for (const side of [-1, 1]) {
    const [y0, y1] = [side * half * 0.95, side * (half + 0.18)].sort((a, b) => a - b);
    mesh.box([x - 0.05, y0, z], [x + 0.08, y1, z + size], TRIM);
  }
}

/** Dark discs behind the wheels; `half`: width of the flank [m]. */
function arches(mesh: MeshBuilder,
  { front, rear, radius }: { front: number; rear: number; radius: number }, half: number) {
  for (const x of [front, rear]) {
    mesh.cylinder([x, 0, radius + 0.05], 'y', 2 * half + 0.008, radius + 0.05, TRIM, TRIM, 18);
  }
}

/** Add the unlit lamps to a vehicle: headlights and red lenses; return the same. */
export function withLamps(body: Body): Body {
  if (body.lamps !== null) {
    const { front, rear, size: [width, height] } = body.lamps;
    for (const side of [-1, 1]) {
      lamp(body.mesh, front, side, width, 0.8 * height, HEADLIGHT);
      lamp(body.mesh, rear, side, width, height, LENS);
    }
  }
  return body;
}

/** `side`: 1 for the left one, -1 for the right one; `width` [m]; `height` [m]. */
function lamp(mesh: MeshBuilder, [x, y, z]: Point, side: number, width: number, height: number,
  tint: Tint) {
  mesh.box([x - 0.03, side * y - 0.5 * width, z - 0.5 * height],
    [x + 0.03, side * y + 0.5 * width, z + 0.5 * height], tint);
}
