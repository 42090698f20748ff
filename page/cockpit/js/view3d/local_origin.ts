// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * The origin of the 3D view's coordinates.
 *
 * They are the map's, x east, y north, and z up (also three.js's up vector, for all cameras), in
 * metres, but relative to a point in the middle of the map: the graphics card computes in float32,
 * whose resolution at the 1e6 m of UTM coordinates is only 0.1 m.
 */

import type { Scene } from '../messages.js';

export interface Origin { x: number; y: number } // in the map's coordinates [m]

/**
 * Return the origin of a scene: always the same one for the same scene.
 * @returns whole metres, amid the map; local x = map x - origin x
 */
export function localOrigin({ bounds: [xmin, ymin, xmax, ymax] }: Pick<Scene, 'bounds'>): Origin {
  return { x: Math.round((xmin + xmax) / 2), y: Math.round((ymin + ymax) / 2) };
}
