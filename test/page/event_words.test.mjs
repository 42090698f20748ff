// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The actions and conditions of a game's events, in words. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { baseName, conditionWords, eventKind, eventWords } from
  '../../page/cockpit/js/panels/event_words.js';

const event = (kind, more) => ({ name: 'e', label: 'E', when: null, kind, ...more });

for (const [kind, more, words] of [
  ['release', { object: '7' }, 'Releases obstacle 7, which waits until then.'],
  ['brake', { object: '7', deceleration: 4, speed: 0 },
    'Obstacle 7 brakes at 4.0 m/s² to a stop.'],
  // 25 m/s are 90 km/h.
  ['brake', { object: '7', deceleration: 4.25, speed: 25 },
    'Obstacle 7 brakes at 4.3 m/s² to 90 km/h.'],
  ['obstacle', { x: 10.4, y: -3, length: 4, width: 2, type: 'roadBoundary' },
    'Puts a barrier of 4.0 × 2.0 m at (10, \u22123).'],
  ['obstacle', { x: 0, y: 0, length: 1, width: 1, type: 'sofa' },
    'Puts an obstacle of 1.0 × 1.0 m at (0, 0).'],
  ['speed_limit', { speed: 100 / 3.6, lanelets: [] },
    'Sets the speed limit of all roads to 100 km/h.'],
  ['speed_limit', { speed: 10, lanelets: [4] }, 'Sets the speed limit of lanelet 4 to 36 km/h.'],
  ['speed_limit', { speed: 10, lanelets: [4, 5] },
    'Sets the speed limit of lanelets 4, 5 to 36 km/h.'],
  ['traffic', { agent: 'all', speed_factor: 0.8, red_runner: true, options: { time_gap: 2 } },
    'All agents of traffic from then on: 80 % of the speed limit, time gap 2, ignores lights.'],
  ['traffic', { agent: 't3', desired_speed: 10, lane_changes: false, reaction_time: 0.7 },
    'Agent t3 from then on: 36 km/h whatever the limit, no lane changes, reaction time 0.7 s.'],
  ['plan_display', { av: 'av0', show: false }, 'Hides the plan of av0.'],
  ['planner', { av: 'av0', planner: '/home/x/mine.py:Mine' },
    'Replaces the planner of av0 by mine.py:Mine.'],
  ['planner_run', { av: 'av0', run: true }, 'Lets the planner of av0 go on.'],
  ['planner_run', { av: 'av0', run: false },
    'Stops the planner of av0: it is asked for no plan.'],
]) {
  test(`${kind}: ${words}`, () => assert.equal(eventWords(event(kind, more)), words));
}

test('an unknown kind is described by its parameters', () => {
  const unknown = event('weather', { rain: 0.5, wet: true, fields: [1, 2] });
  assert.equal(eventKind(unknown), 'weather');
  assert.equal(eventKind(event('new_kind')), 'new kind');
  assert.equal(eventWords(unknown), 'rain 0.5, wet true');
  assert.equal(eventKind(event('toString')), 'toString');
});

test('the condition under which it fires by itself', () => {
  assert.equal(conditionWords(null), '');
  assert.equal(conditionWords({ time: 0 }), 'by itself at 0.0 s');
  assert.equal(conditionWords({ step: 30 }), 'by itself at step 30');
  assert.equal(conditionWords({ between: ['hv0', 'av0'], distance: 20 }),
    'by itself when hv0 and av0 are within 20 m');
  assert.equal(conditionWords({ vehicle: 'hv0', x: 100, y: -2.4, radius: 15 }),
    'by itself when hv0 is within 15 m of (100, \u22122)');
});

test('only the name of a file is shown, and what follows it', () => {
  assert.equal(baseName('idm'), 'idm');
  assert.equal(baseName('keys:/home/somebody/runs/lap.keys.yaml'), 'keys:lap.keys.yaml');
  assert.equal(baseName(null), '');
});
