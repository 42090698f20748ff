// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The boundary lines of all lanelets, each once, although two neighbours describe it. */

/** @import { Lanelet } from '../messages.js' */

// Neighbours' bounds are the same line when their ends are this close [m].
const SAME_M = 0.3;

// Order of markings by visibility.
const RANK = [
  'no_marking', 'unknown', 'dashed', 'dashed_dashed', 'solid', 'lowered_curb', 'curb',
  'dashed_solid', 'solid_dashed', 'solid_solid', 'broad_dashed', 'broad_solid',
];

/**
 * @typedef {object} Boundary
 * @property {number[]} line flat
 * @property {string} marking CommonRoad's name
 * @property {number} owner index of its lanelet
 * @property {boolean} inner between two lanelets
 */

/**
 * Collect the boundaries of a scene.
 *
 * @param {Lanelet[]} lanelets of the scene document
 * @returns {Boundary[]}
 */
export function collectBoundaries(lanelets) {
  const index = new Map(lanelets.map((lanelet, i) => [lanelet.id, i]));
  /** @type {Map<string, Boundary>} */
  const drawn = new Map();
  /** @type {Boundary[]} */
  const boundaries = [];
  lanelets.forEach((lanelet, owner) => {
    for (const side of /** @type {const} */ (['left', 'right'])) {
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

/**
 * @param {Lanelet} lanelet
 * @param {'left'|'right'} side
 */
function sideOfNeighbour(lanelet, side) {
  const other = side === 'left' ? 'right' : 'left';
  return lanelet[`adj_${side}_same`] ? other : side;
}

/**
 * @param {number[]} one
 * @param {number[]} two
 */
function sameLine(one, two) {
  const end = one.length - 2;
  const last = two.length - 2;
  /** @type {(i: number, j: number) => boolean} */
  const near = (i, j) => Math.hypot(one[i] - two[j], one[i + 1] - two[j + 1]) < SAME_M;
  return (near(0, 0) && near(end, last)) || (near(0, last) && near(end, 0));
}

/**
 * @param {string} one
 * @param {string} two
 */
function moreVisible(one, two) {
  return RANK.indexOf(two) > RANK.indexOf(one) ? two : one;
}
