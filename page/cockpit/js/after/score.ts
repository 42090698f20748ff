// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The scores of the driven vehicles, which the server computes from the recording. */

import { element } from '../dom.js';
import { fixed } from '../panels/format.js';
import { KMH } from '../units.js';

import type { Score, VehicleScore } from '../api_messages.js';


/** The state of a score: being computed, the score, or why there is none. */
export type Scored = { state: 'waiting' } | { state: 'told'; score: Score }
  | { state: 'none'; why: string };

/** Build the table of scores; `mine`: the vehicle that this page drives, shown first. */
export function scoreBlock(scored: Scored, mine: string | null): HTMLElement {
  const root = element('section', { class: 'score', 'aria-label': 'Score',
    'data-state': scored.state });
  if (scored.state === 'waiting') {
    root.append(element('p', { class: 'dim', role: 'status', text: 'Scoring the run …' }));
  } else if (scored.state === 'none' || scored.score.vehicles.length === 0) {
    const why = scored.state === 'none' ? scored.why : scored.score.refusal;
    root.append(element('p', {
      class: 'dim', text: `No score: ${why || 'no vehicle was driven'}`,
    }));
  } else {
    const { vehicles } = scored.score;
    const rank = (
      { vehicle, role }: VehicleScore) => (vehicle === mine ? 0 : role === 'human' ? 1 : 2);
    const [first, ...others] = [...vehicles].sort((a, b) => rank(a) - rank(b));
    root.append(vehicleScore(first, true), ...others.map((each) => vehicleScore(each, false)));
  }
  return root;
}

/** @param open whether its parts are shown at once */
function vehicleScore({ vehicle, role, score, parts, distance, fastest, remarks }: VehicleScore,
  open: boolean) {
  const points = score === null ? '–' : fixed(100 * score, 0);
  return element('details', { class: 'score-vehicle', open, 'data-vehicle': vehicle },
    element('summary', { title: 'Multipliers times the weighted mean, as nuPlan scores a drive' },
      element('strong', { class: role === 'human' ? 'human' : 'av', text: vehicle }),
      element('span', { class: 'score-points', text: points }),
      element('span', { class: 'dim', text: score === null ? remarks.join('; ') : 'of 100' }),
      element('span', { class: 'score-way',
        text: `${fixed(distance, 0)} m, up to ${fixed((fastest ?? NaN) * KMH, 0)} km/h` })),
    element('ul', { class: 'score-parts' }, ...parts.map(
      ({ name, value, weight, definition }) => element('li', {
        title: `${definition}; ${weight > 0 ? `weight ${weight}` : 'multiplies the rest'}`,
        'data-short': value !== null && value < 1 },
      element('span', { text: name }),
      element('meter', { min: 0, max: 1, low: 0.5, high: 0.9, optimum: 1, value: value ?? 0,
        'aria-label': name }),
      element('b', { text: value === null ? '–' : `${fixed(100 * value, 0)} %` })))));
}
