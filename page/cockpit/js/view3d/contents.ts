// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** What is where in a picture of the 3D view, by the ids that the recording has. */

import { boxOf, distanceTo } from './solid_boxes.js';

import type { ShownThing, ViewEye } from '../page_messages.js';
import type { Stand } from './cameras.js';
import type { Rectangle } from './mirrors.js';
import type { Box, Elements, Solid, Triple } from './solid_boxes.js';

/** A solid with its id, and what it is. */
export interface Named extends Solid {
  kind: 'vehicle' | 'pedestrian' | 'object' | 'sign' | 'traffic_light';
  id: string;
}

/** A camera: its projection after the change to its coordinates, and its place in the scene. */
export interface Sighting { view: Elements; eye: Triple }
/** A mirror; its place in the picture in CSS pixels, counted from below. */
export interface SeenMirror extends Sighting { name: string; rectangle: Rectangle }

export interface Contents { eye: ViewEye; shown: ShownThing[] }

// Smaller things are not told: a car at 600 m [share of the picture's width or height].
const SMALLEST = 0.002;
const DIGITS = 4;

/** Return what a camera sees, the nearest first; `things` in the scene's coordinates. */
export function seenBy({ view, eye }: Sighting, things: readonly Named[]): ShownThing[] {
  return things.flatMap((thing): ShownThing[] => {
    const box = boxOf(view, thing);
    return box === null || Math.max(box.right - box.left, box.bottom - box.top) < SMALLEST ? []
      : [thingOf(thing.kind, thing.id, box, distanceTo(thing, eye))];
  }).sort((one, other) => (one[6] ?? 0) - (other[6] ?? 0));
}

/** Return a mirror, and before it what is seen in it; `size` of the picture [CSS px]. */
export function mirrorOf(mirror: SeenMirror, things: readonly Named[],
  size: { width: number; height: number }): ShownThing[] {
  const { left, bottom, width, height } = mirror.rectangle;
  const glass = { left: left / size.width, right: (left + width) / size.width,
    top: 1 - (bottom + height) / size.height, bottom: 1 - bottom / size.height };
  const across = (share: number) => glass.left + share * (glass.right - glass.left);
  const down = (share: number) => glass.top + share * (glass.bottom - glass.top);
  const id = `mirror_${mirror.name}`;
  const seen = seenBy(mirror, things).map(([kind, name, l, t, r, b, distance_m]): ShownThing => (
    // Its picture is turned over, left to right.
    thingOf(kind, name, { left: across(1 - r), top: down(t), right: across(1 - l),
      bottom: down(b) }, distance_m ?? null, id)));
  return [...seen, thingOf('mirror', id, glass, null)];
}

/** Return an entry of the message, in its order and precision; `mirror` in which it is seen. */
export function thingOf(kind: ShownThing[0], id: string, { left, top, right, bottom }: Box,
  distance_m: number | null, mirror: string | null = null): ShownThing {
  const share = (value: number) => rounded(Math.min(Math.max(value, 0), 1), DIGITS);
  return [kind, id, share(left), share(top), share(right), share(bottom),
    distance_m === null ? null : rounded(distance_m, 2), mirror];
}

/**
 * Return the eye of a camera that is not rolled, above the plane of the road under a vehicle.
 * @param stand of the vehicle, in the map
 * @param point of the eye, in the map
 * @param forwards direction in which it looks, of length 1
 * @param height angle of the picture in height [rad]
 * @param aspect width of the picture through its height
 */
export function eyeOf(stand: Stand, point: Triple, forwards: Triple, height: number,
  aspect: number): ViewEye {
  const { yaw, slope } = stand;
  const up = [-Math.sin(slope) * Math.cos(yaw), -Math.sin(slope) * Math.sin(yaw),
    Math.cos(slope)];
  const along = (direction: readonly number[]) => direction.reduce(
    (sum, value, i) => sum + value * up[i], 0);
  const tall = Math.tan(height / 2);
  const above = along([point[0] - stand.x, point[1] - stand.y, point[2] - stand.z]);
  return [rounded(point[0], 2), rounded(point[1], 2), rounded(yaw, 5),
    rounded(Math.max(above, 0), 3),
    rounded(Math.asin(Math.min(Math.max(along(forwards), -1), 1)), 5),
    rounded(tall * aspect, 5), rounded(tall, 5)];
}

function rounded(value: number, digits: number) {
  return Math.round(value * 10 ** digits) / 10 ** digits;
}
