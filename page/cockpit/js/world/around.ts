// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The content of the map in words, for users who cannot see it and for tests. */

import { element, setText } from '../dom.js';
import { OBJECT_WIDTH, VEHICLE, VEHICLE_WIDTH } from '../frames.js';
import { icon } from '../panels/icons.js';
import { recall, remember } from '../panels/memory.js';
import { KMH } from '../units.js';
import { driverSight } from './driver_sight.js';

import type { Shown, Store } from '../store.js';

const EVERY_MS = 1000;
// Objects farther away are left out [m].
const REACH = 100;
const MOST_TOLD = 5;
const STANDING = 0.3;

// [m, rad, m/s]
export interface Body { id: string; x: number; y: number; yaw: number; speed: number }

/**
 * Describe the objects around a vehicle, the nearest first.
 * @param driven whether this page drives it
 * @param range visibility [m]
 */
export function describeAround(own: Body, others: Body[], driven: boolean,
  range = Infinity): string {
  const reach = Math.min(REACH, range);
  const near = others.map((other) => ({
    other, distance: Math.hypot(other.x - own.x, other.y - own.y) }))
    .filter(({ distance }) => distance <= reach).sort((a, b) => a.distance - b.distance);
  const told = near.slice(0, MOST_TOLD).map(({ other, distance }) => (
    `${other.id} ${Math.round(distance)} m ${directionOf(own, other)}, ${pace(other.speed)}`));
  const more = near.length - told.length;
  return [`${driven ? 'You drive' : 'Watching'} ${own.id}, ${pace(own.speed)}.`,
    told.length === 0 ? `No other within ${Math.round(reach)} m.`
      : `Around: ${told.join('; ')}${more > 0 ? `; and ${more} more` : ''}.`].join(' ');
}

/** @param speed [m/s] */
function pace(speed: number) {
  return Math.abs(speed) < STANDING ? 'standing'
    : `${Math.round(Math.abs(speed) * KMH)} km/h${speed < 0 ? ' backwards' : ''}`;
}

/** Return one of eight directions, as seen by the driver. */
function directionOf(own: Body, other: Body) {
  const angle = Math.atan2(other.y - own.y, other.x - own.x) - own.yaw;
  const eighth = Math.round(angle / (Math.PI / 4)) & 7;
  return ['ahead', 'ahead left', 'left', 'behind left', 'behind', 'behind right', 'right',
    'ahead right'][eighth];
}

/** Keep the text up to date, once a second at most; it is read out only on request. */
export function createAround(root: HTMLElement, store: Store): { describe: () => string } {
  const describe = () => {
    const seat = window.crgame.driving?.seat ?? null;
    const id = seat ?? window.crgame.world.followed;
    const shown = store.displayed(performance.now());
    const bodies = shown === null ? [] : bodiesOf(store, shown);
    const own = bodies.find((body) => body.id === id);
    return own === undefined ? `The whole map, with ${bodies.length} vehicles and objects.`
      : describeAround(own, bodies.filter((body) => body !== own), seat !== null,
        driverSight(store)?.range);
  };
  const button = element('button', { type: 'button', class: 'icon-button', id: 'announce',
    'aria-label': 'Read out what is around', title: 'Read out what is around', on: {
      click: () => announce(root.getAttribute('aria-live') !== 'polite'),
    } }, icon('speech'));
  const announce = (on: boolean) => {
    root.setAttribute('aria-live', on ? 'polite' : 'off');
    button.setAttribute('aria-pressed', String(on));
    remember('announce', on ? 'yes' : '');
  };
  document.querySelector('#bar-end')?.append(button);
  announce(recall('announce') === 'yes');
  setInterval(() => {
    if (store.scene !== null && !document.hidden) {
      setText(root, describe());
    }
  }, EVERY_MS);
  return { describe };
}

/** @returns the present bodies */
function bodiesOf({ scene }: Store, { vehicles, objects }: Shown): Body[] {
  const driven = (scene?.vehicles ?? []).map(({ id }, i) => {
    const row = vehicles.subarray(i * VEHICLE_WIDTH, (i + 1) * VEHICLE_WIDTH);
    return { id, x: row[VEHICLE.x], y: row[VEHICLE.y], yaw: row[VEHICLE.yaw],
      speed: row[VEHICLE.speed] };
  });
  const others = (scene?.objects ?? []).map(({ id, type }, i) => {
    const [x, y, yaw, vx, vy] = objects.subarray(i * OBJECT_WIDTH, (i + 1) * OBJECT_WIDTH);
    return { id: `${type} ${id}`, x, y, yaw, speed: Math.hypot(vx, vy) };
  });
  return [...driven, ...others].filter(({ x }) => Number.isFinite(x));
}
