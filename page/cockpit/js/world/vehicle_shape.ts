// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Shapes of things from above: paths in metres around the centre, x forward. */

import { addPolygon } from './polyline.js';

import type { Shape } from '../messages.js';

export interface Look {
  body: Path2D; // filled in the colour of its role
  glass: Path2D | null; // windows: the windscreen shows where the front is
  roof: Path2D | null; // over the glass, in the body's colour
  lamps: Path2D | null; // at the front
  brakes: Path2D | null; // lamps at the back
  indicators: { left: Path2D; right: Path2D } | null; // at the corners
  extent: number; // the longer side [m]
  radius: number; // of the circle around it [m]
}

export type Parts = Omit<Look, 'extent' | 'radius' | 'indicators'>;

const LONG_VEHICLES = new Set(['truck', 'bus', 'train']);
const TWO_WHEELS = new Set(['bicycle', 'motorcycle']);
const CARS = new Set(['car', 'parkedVehicle', 'taxi', 'priorityVehicle', 'unknown']);

/**
 * Build the look of a vehicle or obstacle.
 * @param type CommonRoad obstacle type
 * @param moves whether it has a front
 * @returns paths around the shape's centre
 */
export function vehicleLook(type: string, shape: Shape, moves: boolean): Look {
  const { kind, length, width } = shape;
  const rest = {
    extent: Math.max(length, width), radius: 0.5 * Math.hypot(length, width),
    indicators: type === 'pedestrian' || kind !== 'rectangle' ? null : corners(length, width),
  };
  if (type === 'pedestrian') {
    return { ...pedestrian(length, width), ...rest };
  }
  if (kind === 'rectangle' && TWO_WHEELS.has(type)) {
    return { ...twoWheeler(length, width), ...rest };
  }
  if (kind === 'rectangle' && LONG_VEHICLES.has(type)) {
    return { ...longVehicle(length, width, type === 'truck'), ...rest };
  }
  // A thing without the proportions of a vehicle gets no windscreen.
  if (kind === 'rectangle' && CARS.has(type) && (moves || type === 'parkedVehicle')
      && length > 2 && length < 9 && width > 1 && width < 3.2) {
    return { ...car(length, width), ...rest };
  }
  return { ...block(shape, moves), ...rest };
}

/** A tyre seen from above, around its own centre. */
export const TYRE = boxes([[-0.33, -0.12, 0.66, 0.24]], 0.08);

function car(length: number, width: number): Parts {
  const l = length / 2;
  const w = width / 2;
  const body = new Path2D();
  body.moveTo(-l + 0.25 * w, -w);
  body.lineTo(l - 0.75 * w, -w);
  body.quadraticCurveTo(l - 0.04 * w, -0.97 * w, l, -0.5 * w);
  body.quadraticCurveTo(l + 0.01 * w, 0, l, 0.5 * w);
  body.quadraticCurveTo(l - 0.04 * w, 0.97 * w, l - 0.75 * w, w);
  body.lineTo(-l + 0.25 * w, w);
  body.quadraticCurveTo(-l, w, -l, 0.7 * w);
  body.lineTo(-l, -0.7 * w);
  body.quadraticCurveTo(-l, -w, -l + 0.25 * w, -w);
  body.closePath();
  const glass = new Path2D();
  glass.moveTo(-0.78 * l, -0.66 * w);
  glass.quadraticCurveTo(-0.2 * l, -0.95 * w, 0.36 * l, -0.8 * w);
  glass.quadraticCurveTo(0.52 * l, 0, 0.36 * l, 0.8 * w);
  glass.quadraticCurveTo(-0.2 * l, 0.95 * w, -0.78 * l, 0.66 * w);
  glass.closePath();
  const roof = new Path2D();
  roof.moveTo(-0.6 * l, -0.6 * w);
  roof.lineTo(0.1 * l, -0.66 * w);
  roof.quadraticCurveTo(0.17 * l, 0, 0.1 * l, 0.66 * w);
  roof.lineTo(-0.6 * l, 0.6 * w);
  roof.closePath();
  return { body, glass, roof, ...lamps(l, w) };
}

function lamps(l: number, w: number) {
  return {
    lamps: boxes([[l - 0.34, 0.5 * w, 0.2, 0.34 * w], [l - 0.34, -0.84 * w, 0.2, 0.34 * w]], 0.06),
    brakes: boxes([[-l, 0.46 * w, 0.26, 0.48 * w], [-l, -0.94 * w, 0.26, 0.48 * w]], 0.06),
  };
}

function corners(length: number, width: number) {
  // Half beyond the body, so that they are visible from afar and on any colour.
  const l = length / 2;
  const deep = 0.3 * width;
  const along = 0.16 * length;
  const at = [l - along, -l];
  const side = (y: number): Path2D => boxes(at.map((x) => [x, y, along, deep]), 0.08);
  return { left: side(width / 2 - 0.4 * deep), right: side(-width / 2 - 0.6 * deep) };
}

function longVehicle(length: number, width: number, isTruck: boolean): Parts {
  const l = length / 2;
  const w = width / 2;
  const body = boxes([[-l, -w, length, width]], 0.25);
  const glass = boxes([[l - 0.95, -0.86 * w, 0.6, 1.72 * w]], 0.15);
  if (isTruck) {
    // The gap between cab and load.
    glass.rect(l - 2.3, -0.95 * w, 0.16, 1.9 * w);
  }
  return { body, glass, roof: null, ...lamps(l, w) };
}

function twoWheeler(length: number, width: number): Parts {
  const l = length / 2;
  const w = Math.max(width / 2, 0.2);
  const body = boxes([[-l, -0.16, length, 0.32]], 0.16);
  body.roundRect(0.28 * l, -w, 0.14, 2 * w, 0.07);
  const rider = new Path2D();
  rider.ellipse(-0.12 * l, 0, 0.26, Math.max(0.8 * w, 0.26), 0, 0, 2 * Math.PI);
  const head = new Path2D();
  head.arc(-0.05 * l, 0, 0.15, 0, 2 * Math.PI);
  body.addPath(rider);
  return {
    body, glass: head, roof: null, lamps: boxes([[l - 0.16, -0.08, 0.14, 0.16]], 0.05),
    brakes: boxes([[-l, -0.12, 0.18, 0.24]], 0.05),
  };
}

function pedestrian(length: number, width: number): Parts {
  const body = new Path2D();
  body.ellipse(0, 0, length / 2, width / 2, 0, 0, 2 * Math.PI);
  body.moveTo(0.5 * length, -0.24 * width);
  body.lineTo(0.78 * length, 0);
  body.lineTo(0.5 * length, 0.24 * width);
  const head = new Path2D();
  head.arc(0.05 * length, 0, 0.24 * Math.min(length, width), 0, 2 * Math.PI);
  return { body, glass: head, roof: null, lamps: null, brakes: null };
}

function block({ kind, length, width, vertices }: Shape, moves: boolean): Parts {
  const body = new Path2D();
  if (kind === 'circle') {
    body.arc(0, 0, length / 2, 0, 2 * Math.PI);
  } else if (kind === 'polygon') {
    addPolygon(body, vertices, 0, 0);
  } else {
    body.rect(-length / 2, -width / 2, length, width);
  }
  let nose = null;
  if (moves) {
    const size = 0.3 * Math.min(length, width);
    nose = new Path2D();
    nose.moveTo(length / 2 - 0.3 * size, 0);
    nose.lineTo(length / 2 - 1.5 * size, size);
    nose.lineTo(length / 2 - 1.5 * size, -size);
    nose.closePath();
  }
  return { body, glass: nose, roof: null, lamps: null, brakes: null };
}

function boxes(list: number[][], radius: number) {
  const path = new Path2D();
  for (const [x, y, length, width] of list) {
    path.roundRect(x, y, length, width, radius);
  }
  return path;
}
