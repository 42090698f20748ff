// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The choice of a vehicle's or object's body, its size and its colours. */

import { bus, car, truck, van, withLamps } from './motor_vehicles.js';
import { bicycle, motorcycle, pedestrian, prism } from './others.js';

import type { SceneObject, SceneVehicle } from '../../messages.js';
import type { Body } from './motor_vehicles.js';

export interface Appearance {
  key: string; // things with the same key share their body
  build: () => Body; // the body, at its own size
  length: number | null; // to which it is stretched; null for its own size [m]
  width: number | null; // [m]
  height: number | null; // [m]
  paint: number; // its colour, which only distinguishes things
}

// Usual colours of cars: silver, grey, black, white, red, blue, brown, green.
const PAINTS = [0xb9bec4, 0x6d737b, 0x22252a, 0xe9eaec, 0x8f1d22, 0x24426f, 0x5a4636, 0x2f4f43];
const CLOTHES = [0x3f6ea8, 0xa33c3c, 0x4b7f52, 0xc79a3a, 0x6b5a8e, 0xd9d4c8];
const STATIC_PAINT = 0xc8641e;
// Heights of things whose type defines them better than their outline [m].
const HEIGHTS: Record<string, number | undefined> = {
  building: 8, pillar: 4, median_strip: 0.2, medianStrip: 0.2, roadBoundary: 0.8,
  constructionZone: 1.1,
};
const USUAL_HEIGHT_M = 1.2;
const LONGEST_CAR_M = 5.3;
const LONGEST_VAN_M = 7.5;
const CIRCLE_CORNERS = 16;
const CARS = new Set(['car', 'parkedVehicle', 'taxi', 'priorityVehicle', 'unknown']);

/**
 * Choose the body of a driven vehicle: the wheels of cars and trucks are where its model has them.
 */
export function ofVehicle(vehicle: SceneVehicle): Appearance {
  const { id, type, shape, wheelbase, rear_to_center: rear, driver_place: place } = vehicle;
  if (type !== 'car' && type !== 'truck') {
    return ofObject({ id, type, role: 'traffic', shape });
  }
  const { length, width } = shape;
  const [name, build] = motorVehicle(length);
  return {
    key: `${name} ${(wheelbase / length).toFixed(3)} ${(rear / length).toFixed(3)}`,
    build: () => {
      const size = build().length;
      return withLamps(build({ front: (wheelbase - rear) / length * size,
        rear: -rear / length * size }));
    },
    length, width, height: place.height, paint: pick(PAINTS, id),
  };
}

/** Choose the body of an object by its type and size, from CommonRoad. */
export function ofObject({ id, type, role, shape }: SceneObject): Appearance {
  const { kind, length, width } = shape;
  const size = { length, width, height: null };
  if (type === 'pedestrian') {
    return { ...size, key: type, build: pedestrian, paint: pick(CLOTHES, id) };
  }
  if (kind === 'rectangle' && (type === 'bicycle' || type === 'motorcycle')) {
    return { key: type, build: type === 'bicycle' ? bicycle : () => withLamps(motorcycle()),
      length, width: null, height: null, paint: pick(type === 'bicycle' ? CLOTHES : PAINTS, id) };
  }
  const moves = role !== 'static' || type === 'parkedVehicle';
  if (kind === 'rectangle' && (type === 'bus' || type === 'train')) {
    return { ...size, key: 'bus', build: () => withLamps(bus()), paint: pick(PAINTS, id) };
  }
  const fits = length > 2 && width > 1 && width < 3.2;
  if (kind === 'rectangle' && (type === 'truck' || (CARS.has(type) && moves && fits))) {
    const [name, build] = motorVehicle(length);
    return { ...size, key: name, build: () => withLamps(build()), paint: pick(PAINTS, id) };
  }
  const vertices = outlineOf(shape);
  return { length: null, width: null, height: null, key: `${type} ${vertices.join()}`,
    build: () => prism(vertices, HEIGHTS[type] ?? USUAL_HEIGHT_M), paint: STATIC_PAINT };
}

/** @param length [m] */
function motorVehicle(length: number): [name: string, build: typeof car] {
  return length <= LONGEST_CAR_M ? ['car', car] : length <= LONGEST_VAN_M ? ['van', van]
    : ['truck', truck];
}

/** @returns flat */
function outlineOf({ kind, length, width, vertices }: SceneObject['shape']): number[] {
  if (kind === 'polygon') {
    return vertices;
  }
  if (kind === 'circle') {
    return Array.from({ length: 2 * CIRCLE_CORNERS }, (_, i) => {
      const angle = (2 * Math.PI * Math.floor(i / 2)) / CIRCLE_CORNERS;
      return 0.5 * length * (i % 2 === 0 ? Math.cos(angle) : Math.sin(angle));
    });
  }
  const [l, w] = [length / 2, width / 2];
  return [-l, -w, l, -w, l, w, -l, w];
}

function pick(colors: number[], id: string) {
  let hash = 7;
  for (const letter of id) {
    hash = (31 * hash + letter.charCodeAt(0)) % 65521;
  }
  return colors[hash % colors.length];
}
