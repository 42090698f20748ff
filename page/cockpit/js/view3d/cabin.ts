// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The driver's view of the own vehicle: bonnet, pillars, doors and the edge of the dashboard. */

import { MeshBuilder } from './bodies/mesh_builder.js';
import { geometryOf } from './instances.js';

import type { SceneVehicle } from '../messages.js';
import type { Point, Tint } from './bodies/mesh_builder.js';
import type { Three } from './three.js';

const INSIDE: Tint = [0.035, 0.037, 0.042];
const DASH: Tint = [0.025, 0.026, 0.03];
const PILLAR_M = 0.05;

/**
 * Make the inside of a vehicle, relative to its rear axle on the road.
 * @param paint its colour
 * @returns seen from the driver's eye only
 */
export function createCabin(three: Three, vehicle: SceneVehicle, paint: number) {
  const mesh = new MeshBuilder();
  const { r, g, b } = new three.Color(paint);
  addBonnet(mesh, vehicle, [r, g, b]);
  addFrame(mesh, vehicle);
  const cabin = new three.Mesh(geometryOf(three, mesh.arrays(false)),
    new three.MeshLambertMaterial({ vertexColors: true, side: three.DoubleSide }));
  cabin.frustumCulled = false;
  // Drawn first, so that hidden parts are not computed.
  cabin.renderOrder = -1;
  return cabin;
}

/** A crowned sheet from the windscreen to the bumper, which sinks towards its front. */
function addBonnet(mesh: MeshBuilder,
  { shape, rear_to_center: rear, driver_place: place }: SceneVehicle, tint: Tint) {
  const front = rear + shape.length / 2;
  const screen = Math.min(place.left_mirror[0] + 0.05, front - 0.2);
  const half = shape.width / 2;
  const top = place.bonnet_height;
  const count = 6;
  const sections: Point[][] = Array.from({ length: count + 1 }, (_, i) => {
    const share = i / count;
    const x = screen + share * (front - screen);
    const drop = 0.03 * share + 0.26 * share ** 2.2;
    const wide = half * (0.95 - 0.16 * share ** 2);
    return [-1, -0.8, -0.4, 0, 0.4, 0.8, 1].map((
      side) => [x, side * wide, top - drop - 0.11 * side ** 4 - 0.012 * (1 - Math.abs(side))]);
  });
  mesh.skin(sections, () => tint);
}

function addFrame(mesh: MeshBuilder,
  { shape, rear_to_center: rear, driver_place: place }: SceneVehicle) {
  const half = shape.width / 2;
  const [eyeX, , eyeZ] = place.eye;
  const screen = Math.min(place.left_mirror[0] + 0.05, rear + shape.length / 2 - 0.2);
  const roofX = Math.min(eyeX + 0.35, screen - 0.1);
  const roofZ = place.height - 0.07;
  const belt = Math.min(place.bonnet_height, eyeZ - 0.2);
  const back = rear - shape.length / 2 + 0.5;
  mesh.box([screen - 0.42, -half + 0.06, belt - 0.2], [screen, half - 0.06, belt - 0.015], DASH)
    .box([back, -half + 0.1, roofZ], [roofX, half - 0.1, roofZ + 0.05], INSIDE);
  for (const side of [-1, 1]) {
    const low = side * (half - 0.05);
    const high = side * (half - 0.2);
    bar(mesh, [screen, low, belt - 0.03], [roofX, high, roofZ + 0.02], PILLAR_M);
    bar(mesh, [roofX, high, roofZ + 0.01], [back + 0.5, high, roofZ + 0.01], PILLAR_M);
    bar(mesh, [eyeX - 0.3, low, belt - 0.03], [eyeX - 0.45, high, roofZ + 0.02], 1.5 * PILLAR_M);
    const [y0, y1] = [low, side * half].sort((a, b) => a - b);
    mesh.box([back, y0, 0.3], [screen, y1, belt - 0.02], INSIDE);
  }
}

/** A straight bar from one point to another; `width` [m]. */
function bar(mesh: MeshBuilder, from: Point, to: Point, width: number) {
  const w = width / 2;
  const section = ([x, y, z]: Point): Point[] => [[x + w, y - w, z - w], [x + w, y + w, z - w],
    [x - w, y + w, z + w], [x - w, y - w, z + w]];
  mesh.sides(section(from), section(to), INSIDE);
}
