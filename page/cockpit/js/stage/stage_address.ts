// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The settings in the address of a stage, the page for a driver. */

import { VIEWPOINTS } from '../view3d/cameras.js';
import { readAngle } from '../view3d/field_of_view.js';

import type { StageView } from './stage_messages.js';

/** Corners of the view for a photodiode. */
const CORNERS = ['top-left', 'top-right', 'bottom-left', 'bottom-right'] as const;

export interface StageAddress {
  seat: string; // id of the vehicle that is driven
  view: StageView; // at first
  map: boolean; // whether the small map lies over a 3D view
  names: boolean; // whether vehicles are named
  plans: boolean; // whether plans, perception and goals of AVs are shown
  sound: boolean; // whether there is sound, if the game has any
  mirrors: boolean; // whether the driver has them
  change: boolean; // whether V and C change the view
  fieldOfView_deg: number | null; // across the picture; null for the browser's own [deg]
  corner: typeof CORNERS[number] | null; // that is white while a stimulus is shown
}

/**
 * Read a page's address.
 * @param query `?stage=hv0&view=driver&map=1&names=0&plans=0&sound=1&lang=en`
 * @returns null for the full page
 */
export function readStage(query: string): StageAddress | null {
  const values = new URLSearchParams(query);
  const seat = values.get('stage');
  if (seat === null) {
    return null;
  }
  const flag = (name: string,
    usual: boolean): boolean => (usual ? values.get(name) !== '0' : values.get(name) === '1');
  return {
    seat, view: [...VIEWPOINTS, 'map' as const].find(
      (name) => name === values.get('view')) ?? 'driver',
    map: flag('map', true), names: flag('names', false), plans: flag('plans', false),
    sound: flag('sound', true), mirrors: flag('mirrors', true), change: flag('change', false),
    fieldOfView_deg: readAngle(values),
    corner: CORNERS.find((name) => name === values.get('corner')) ?? null,
  };
}
