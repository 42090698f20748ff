// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The limit of a driver's sight by visibility, on the map and in words as in 3D. */

import { OBJECT_WIDTH, VEHICLE_WIDTH } from '../frames.js';

/** @import { Shown, Store } from '../store.js' */

/** @typedef {{id: string, range: number}} Sight from a vehicle, limited by visibility [m] */

/**
 * Return the seat from which this page's person looks.
 *
 * @param {Store} store its scene has the visibility
 * @returns {Sight|null} null without a seat, which sees all: directors, spectators
 */
export function driverSight({ scene }) {
  const { driving, stage, view3d } = window.crgame;
  const id = driving?.seat ?? stage?.address.seat
    ?? (view3d?.on && view3d.viewpoint === 'driver' ? view3d.vehicle : null);
  return scene === null || id === null ? null : { id, range: scene.environment.visibility };
}

/**
 * Remove the objects that are too far away to be visible.
 *
 * @param {Pick<Shown, 'vehicles'|'objects'>} shown x of invisible objects becomes NaN
 * @param {number} own index of the own vehicle; without one, nothing is done
 * @param {number} range [m]
 */
export function hideBeyond({ vehicles, objects }, own, range) {
  const row = own * VEHICLE_WIDTH;
  const [x, y] = [vehicles[row], vehicles[row + 1]];
  for (const [rows, width] of /** @type {const} */ ([
    [vehicles, VEHICLE_WIDTH], [objects, OBJECT_WIDTH]])) {
    for (let i = 0; i < rows.length; i += width) {
      // False for NaN: without an own vehicle, no object is too far away.
      if (Math.hypot(rows[i] - x, rows[i + 1] - y) > range) {
        rows[i] = NaN;
      }
    }
  }
}
