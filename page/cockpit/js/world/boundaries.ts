// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The boundary lines of all lanelets, each once, although two neighbours describe it. */

import type { Lanelet } from '../messages.js';

// Neighbours' bounds are the same line when their ends are this close [m].
const SAME_M = 0.3;

// Order of markings by visibility.
const RANK = [
  'no_marking', 'unknown', 'dashed', 'dashed_dashed', 'solid', 'lowered_curb', 'curb',
  'dashed_solid', 'solid_dashed', 'solid_solid', 'broad_dashed', 'broad_solid',
];

export interface Boundary {
  line: number[]; // flat
  marking: string; // CommonRoad's name
  owner: number; // index of its lanelet
  inner: boolean; // between two lanelets
}

/** Collect the boundaries of a scene; `lanelets` of the scene document. */
export function collectBoundaries(lanelets: Lanelet[]): Boundary[] {
  const index = new Map(lanelets.map((lanelet, i) => [lanelet.id, i]));
  const drawn = new Map<string, Boundary>();
  const boundaries: Boundary[] = [];
  lanelets.forEach((lanelet, owner) => {
    for (const side of ['left', 'right'] as const) {
      const neighbour = index.get(lanelet[`adj_${side}`] ?? NaN);
      const shared = neighbour === undefined ? undefined
        : drawn.get(`${neighbour} ${sideOfNeighbour(lanelet, side)}`);
      if (shared !== undefined && sameLine(shared.line, lanelet[side])) {
        shared.marking = moreVisible(shared.marking, lanelet[`${side}_line`]);
        shared.inner = true;
      } else {
        const boundary = {
          line: lanelet[side], marking: lanelet[`${side}_line`], owner,
          inner: neighbour !== undefined,
        };
        boundaries.push(boundary);
        drawn.set(`${owner} ${side}`, boundary);
      }
    }
  });
  return boundaries;
}

function sideOfNeighbour(lanelet: Lanelet, side: 'left' | 'right') {
  const other = side === 'left' ? 'right' : 'left';
  return lanelet[`adj_${side}_same`] ? other : side;
}

function sameLine(one: number[], two: number[]) {
  const end = one.length - 2;
  const last = two.length - 2;
  const near = (i: number,
    j: number): boolean => Math.hypot(one[i] - two[j], one[i + 1] - two[j + 1]) < SAME_M;
  return (near(0, 0) && near(end, last)) || (near(0, last) && near(end, 0));
}

function moreVisible(one: string, two: string) {
  return RANK.indexOf(two) > RANK.indexOf(one) ? two : one;
}
