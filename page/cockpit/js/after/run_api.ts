// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Requests to the server about past runs; every refusal becomes an Error with one line. */

import { ask, post } from '../panels/scenario_api.js';

import type { PastRun, Score } from '../api_messages.js';
import type { Reply } from '../messages.js';

/** @returns the latest first */
export async function fetchRuns(): Promise<PastRun[]> {
  return (await ask<{ runs: PastRun[] }>('/api/runs')).runs;
}

export function fetchScore(id: string): Promise<Score> {
  return ask(`/api/runs/score?id=${encodeURIComponent(id)}`);
}

export function deleteRun(id: string): Promise<Reply> {
  return post('/api/runs/delete', { id });
}

export const pictureAddress = (id: string) => `/api/runs/picture?id=${encodeURIComponent(id)}`;

export const zipAddress = (id: string) => `/api/runs/zip?id=${encodeURIComponent(id)}`;

/** `id` of a run; `name` of one of its files. */
export const fileAddress = (id: string, name: string) => (
  `/api/runs/file?id=${encodeURIComponent(id)}&file=${encodeURIComponent(name)}`);

/** @param id of a run */
export const replayAddress = (id: string) => `/replay/${encodeURIComponent(id)}/`;

export const comparisonAddress = (ids: string[]) => (
  `/api/runs/comparison?ids=${ids.map(encodeURIComponent).join(',')}`);
