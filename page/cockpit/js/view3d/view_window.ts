// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Windows with only a view: side and rear screens of one seat. */

import { DEGREE } from '../units.js';
import { VIEWPOINTS } from './cameras.js';
import { readAngle } from './field_of_view.js';

import type { Viewpoint } from './cameras.js';


/** The settings of a window. */
export interface ViewWindow {
  viewpoint: Viewpoint;
  aside: number; // to the left of straight ahead [rad]
  vehicle: string | null; // id; null for the vehicle of the seat's first window
  fieldOfView_deg: number | null; // across the window; null for the common setting [deg]
}

/**
 * Read a page's address.
 * @param query `?view=driver&yaw=-60`, degrees to the left; `vehicle` and `fov` besides
 * @returns null for a page with map and panels
 */
export function readViewWindow(query: string): ViewWindow | null {
  const values = new URLSearchParams(query);
  const viewpoint = VIEWPOINTS.find((name) => name === values.get('view'));
  if (viewpoint === undefined || values.has('stage')) {
    return null;
  }
  const yaw = Number(values.get('yaw') ?? 0);
  return {
    viewpoint, aside: Number.isFinite(yaw) ? yaw * DEGREE : 0, vehicle: values.get('vehicle'),
    fieldOfView_deg: readAngle(values),
  };
}
