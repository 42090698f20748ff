// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * The layout of CommonRoad's line markings: widths, dashes and gaps.
 *
 * They follow the German guideline RMS (Richtlinien für die Markierung von Straßen), which
 * distinguishes motorways, country roads and roads in towns.
 */

import { KMH } from '../units.js';

import type { Lanelet } from '../messages.js';
import type { Boundary } from './boundaries.js';

export type RoadClass = 'motorway' | 'country' | 'town';
export type Dash = [painted: number, gap: number]; // [m]

/** One line along a boundary. */
export interface Stroke {
  kind: 'line' | 'broad' | 'curb' | 'lowered' | 'seam';
  offset: number; // of its middle to the left of the boundary [m]
  width: number; // [m]
  dash: Dash | null; // null for an unbroken one
}

const LAYOUTS: Record<RoadClass, { line: number; broad: number; dash: Dash; blocks: Dash }> = {
  motorway: { line: 0.15, broad: 0.3, dash: [6, 12], blocks: [6, 6] },
  country: { line: 0.12, broad: 0.25, dash: [4, 8], blocks: [3, 3] },
  town: { line: 0.12, broad: 0.25, dash: [3, 6], blocks: [3, 3] },
};
const KERB_M = 0.16;
const SEAM_M = 0.08;
// Offset of the two lines of a double line from their middle.
const DOUBLE_LINE_M = 0.13;
const MOTORWAY_TYPES = ['interstate', 'highway', 'mainCarriageWay', 'accessRamp', 'exitRamp'];
// From 95 and 65 km/h on, half-way between two limits [m/s].
const MOTORWAY_MPS = 95 / KMH;
const COUNTRY_MPS = 65 / KMH;

/** Return the class of a lanelet's road, from its types and its speed limit. */
export function roadClass(
  { types, speed_limit }: Pick<Lanelet, 'types' | 'speed_limit'>): RoadClass {
  if (types.some((type) => MOTORWAY_TYPES.includes(type))) {
    return 'motorway';
  }
  const town = types.includes('urban') ? 'town' : 'country';
  if (speed_limit === null) {
    return town;
  }
  return speed_limit > MOTORWAY_MPS ? 'motorway' : speed_limit > COUNTRY_MPS ? 'country' : 'town';
}

/** Return the strokes or kerb along a boundary; `lanelet` whose boundary it is. */
export function strokesOf({ marking, inner }: Pick<Boundary, 'marking' | 'inner'>,
  lanelet: Lanelet): Stroke[] {
  const layout = LAYOUTS[roadClass(lanelet)];
  const line = (style: string, offset: number): Stroke => ({
    kind: 'line', offset, width: layout.line, dash: style === 'solid' ? null : layout.dash });
  const [left, right] = marking.split('_');
  switch (marking) {
    case 'solid':
    case 'dashed': return [line(marking, 0)];
    case 'broad_solid':
      return [{ kind: 'broad', offset: 0, width: layout.broad, dash: null }];
    case 'broad_dashed':
      return [{ kind: 'broad', offset: 0, width: layout.broad, dash: layout.blocks }];
    case 'curb': return [{ kind: 'curb', offset: 0, width: KERB_M, dash: null }];
    case 'lowered_curb': return [{ kind: 'lowered', offset: 0, width: KERB_M, dash: null }];
    case 'solid_solid':
    case 'dashed_dashed':
    case 'solid_dashed':
    case 'dashed_solid':
      return [line(left, DOUBLE_LINE_M), line(right, -DOUBLE_LINE_M)];
    default:
      // Lanes side by side must be distinguishable even without a line.
      return inner && !lanelet.intersection
        ? [{ kind: 'seam', offset: 0, width: SEAM_M, dash: null }] : [];
  }
}
