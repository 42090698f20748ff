// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The limit of a driver's sight by visibility, on the map and in words as in 3D. */

import { OBJECT_WIDTH, VEHICLE_WIDTH } from '../frames.js';

import type { Shown, Store } from '../store.js';

export interface Sight { id: string; range: number } // from a vehicle, limited by visibility [m]

/**
 * Return the seat from which this page's person looks.
 * @param store its scene has the visibility
 * @returns null without a seat, which sees all: directors, spectators
 */
export function driverSight({ scene }: Store): Sight | null {
  const { driving, stage, view3d } = window.crgame;
  const id = driving?.seat ?? stage?.address.seat
    ?? (view3d?.on && view3d.viewpoint === 'driver' ? view3d.vehicle : null);
  return scene === null || id === null ? null : { id, range: scene.environment.visibility };
}

/**
 * Remove the objects that are too far away to be visible.
 * @param shown x of invisible objects becomes NaN
 * @param own index of the own vehicle; without one, nothing is done
 * @param range [m]
 */
export function hideBeyond({ vehicles, objects }: Pick<Shown, 'vehicles' | 'objects'>, own: number,
  range: number) {
  const row = own * VEHICLE_WIDTH;
  const [x, y] = [vehicles[row], vehicles[row + 1]];
  for (const [rows, width] of [
    [vehicles, VEHICLE_WIDTH], [objects, OBJECT_WIDTH]] as const) {
    for (let i = 0; i < rows.length; i += width) {
      // False for NaN: without an own vehicle, no object is too far away.
      if (Math.hypot(rows[i] - x, rows[i + 1] - y) > range) {
        rows[i] = NaN;
      }
    }
  }
}
