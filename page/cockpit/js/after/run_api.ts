// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Requests to the server about past runs; every refusal becomes an Error with one line. */

import { ask, OWN } from '../panels/scenario_api.js';
import { oneLine } from '../panels/format.js';

/** @import { PastRun, Score } from '../messages.js' */

/** @returns {Promise<PastRun[]>} the latest first */
export async function fetchRuns() {
  return (await ask('/api/runs')).runs;
}

/**
 * @param {string} id of a run
 * @returns {Promise<Score>}
 */
export function fetchScore(id) {
  return ask(`/api/runs/score?id=${encodeURIComponent(id)}`);
}

/**
 * @param {string} id of a run
 * @returns {Promise<string>} what was done
 */
export async function deleteRun(id) {
  const reply = await ask('/api/runs/delete', {
    method: 'POST', body: JSON.stringify({ id }),
    headers: { ...OWN, 'Content-Type': 'application/json' },
  });
  return oneLine(reply.text);
}

/** @param {string} id of a run */
export const pictureAddress = (id) => `/api/runs/picture?id=${encodeURIComponent(id)}`;

/** @param {string} id of a run */
export const zipAddress = (id) => `/api/runs/zip?id=${encodeURIComponent(id)}`;

/**
 * @param {string} id of a run
 * @param {string} name of one of its files
 */
export const fileAddress = (id, name) => (
  `/api/runs/file?id=${encodeURIComponent(id)}&file=${encodeURIComponent(name)}`);

/** @param {string} id of a run */
export const replayAddress = (id) => `/replay/${encodeURIComponent(id)}/`;

/** @param {string[]} ids of runs */
export const comparisonAddress = (ids) => (
  `/api/runs/comparison?ids=${ids.map(encodeURIComponent).join(',')}`);
