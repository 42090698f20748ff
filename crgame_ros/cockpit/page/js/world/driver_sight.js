// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Who of the others a driver sees through the air, on the map and in words as in 3D. */

import { OBJECT_WIDTH, VEHICLE_WIDTH } from '../frames.js';

/** @import { Shown, Store } from '../store.js' */

/** @typedef {{id: string, range: number}} Sight from a vehicle, as far as air lets it [m] */

/**
 * Tell from which seat this page's person looks.
 *
 * @param {Store} store its scene says how far one sees
 * @returns {Sight|null} null for who looks from no seat and sees all: directors, spectators
 */
export function driverSight({ scene }) {
  const { driving, stage, view3d } = window.crgame;
  const id = driving?.seat ?? stage?.address.seat
    ?? (view3d?.on && view3d.viewpoint === 'driver' ? view3d.vehicle : null);
  return scene === null || id === null ? null : { id, range: scene.environment.visibility };
}

/**
 * Take out whoever is too far away to be seen: as if they were not there.
 *
 * @param {Pick<Shown, 'vehicles'|'objects'>} shown x of those who are not seen becomes NaN
 * @param {number} own index of the vehicle from which one looks; nothing is done for none
 * @param {number} range [m]
 */
export function hideBeyond({ vehicles, objects }, own, range) {
  const row = own * VEHICLE_WIDTH;
  const [x, y] = [vehicles[row], vehicles[row + 1]];
  for (const [rows, width] of /** @type {const} */ ([
    [vehicles, VEHICLE_WIDTH], [objects, OBJECT_WIDTH]])) {
    for (let i = 0; i < rows.length; i += width) {
      // Not for NaN: where nobody looks from, nobody is too far away.
      if (Math.hypot(rows[i] - x, rows[i + 1] - y) > range) {
        rows[i] = NaN;
      }
    }
  }
}
