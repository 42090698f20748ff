// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Texts that describe an event of a game and the condition under which it fires. */

import { KMH } from '../units.js';
import { fixed, NONE } from './format.js';

import type { EventAction, EventCondition, GameEvent, TrafficAction } from '../messages.js';

const THINGS: Record<string, string> = {
  constructionZone: 'a construction zone', parkedVehicle: 'a parked vehicle',
  roadBoundary: 'a barrier', unknown: 'an obstacle',
};

// The kind in words, and what it does.
const ACTIONS: {
  [Kind in EventAction['kind']]: [title: string,
    words: (event: Extract<EventAction, { kind: Kind }>) => string]
} = {
  release: ['Release', (event) => `Releases obstacle ${event.object}, which waits until then`],
  brake: ['Brake', (event) => `Obstacle ${event.object} brakes at ${fixed(event.deceleration, 1)} `
    + `m/s² to ${event.speed > 0 ? speed(event.speed) : 'a stop'}`],
  obstacle: ['Obstacle', (event) => `Puts ${THINGS[event.type] ?? THINGS.unknown} of `
    + `${fixed(event.length, 1)} × ${fixed(event.width, 1)} m at `
    + `(${fixed(event.x, 0)}, ${fixed(event.y, 0)})`],
  speed_limit: ['Speed limit', (event) => 'Sets the speed limit of '
    + `${lanelets(event.lanelets)} to ${speed(event.speed)}`],
  traffic: ['Traffic', (event) => `${event.agent === 'all' ? 'All agents of traffic'
    : `Agent ${event.agent}`} from then on: ${driving(event)}`],
  plan_display: ['Plan display', (event) => `${event.show ? 'Shows' : 'Hides'} the plan of `
    + event.av],
  planner: ['Planner', (event) => `Replaces the planner of ${event.av} by `
    + baseName(event.planner)],
  planner_run: ['Planner stop or go', (event) => (event.run
    ? `Lets the planner of ${event.av} go on`
    : `Stops the planner of ${event.av}: it is asked for no plan`)],
};

/** Return the kind of an entry of scene.events in words. */
export function eventKind(event: GameEvent): string {
  return Object.hasOwn(ACTIONS, event.kind) ? ACTIONS[event.kind][0]
    : String(event.kind ?? '').replaceAll('_', ' ');
}

/**
 * @param event an entry of scene.events
 * @returns a sentence on what it does; for an unknown kind its parameters
 */
export function eventWords(event: GameEvent): string {
  if (Object.hasOwn(ACTIONS, event.kind)) {
    const words = ACTIONS[event.kind][1] as (event: GameEvent) => string;
    return `${words(event)}.`;
  }
  return Object.entries(event)
    .filter(([key, value]) => !['name', 'label', 'kind', 'when'].includes(key)
      && ['string', 'number', 'boolean'].includes(typeof value))
    .map(([key, value]) => `${key} ${value}`).join(', ');
}

/**
 * @param when the condition of an event
 * @returns the condition in words; empty if only the button fires it
 */
export function conditionWords(when: EventCondition | null | undefined): string {
  if (!when) {
    return '';
  }
  if ('time' in when) {
    return `by itself at ${fixed(when.time, 1)} s`;
  }
  if ('step' in when) {
    return `by itself at step ${when.step}`;
  }
  if ('between' in when) {
    return `by itself when ${when.between.join(' and ')} are within ${fixed(when.distance, 0)} m`;
  }
  return `by itself when ${when.vehicle} is within ${fixed(when.radius, 0)} m of `
    + `(${fixed(when.x, 0)}, ${fixed(when.y, 0)})`;
}

function speed(value: number) {
  const shown = fixed(value * KMH, 0);
  return shown === NONE ? 'another speed' : `${shown} km/h`;
}

function driving(event: TrafficAction) {
  const said: string[] = [];
  const add = <Name extends keyof TrafficAction>(name: Name,
    words: (value: NonNullable<TrafficAction[Name]>) => string) => {
    const value = event[name];
    if (value !== undefined && value !== null) {
      said.push(words(value));
    }
  };
  add('speed_factor', (value) => `${fixed(100 * value, 0)} % of the speed limit`);
  add('desired_speed', (value) => `${speed(value)} whatever the limit`);
  for (const [key, value] of Object.entries(event.options ?? {})) {
    said.push(`${key.replaceAll('_', ' ')} ${value}`);
  }
  add('politeness', (value) => `politeness ${fixed(value, 2)}`);
  add('lane_changes', (value) => (value ? 'lane changes' : 'no lane changes'));
  add('reaction_time', (value) => `reaction time ${fixed(value, 1)} s`);
  add('imperfection', (value) => `imperfection ${fixed(value, 2)}`);
  add('red_runner', (value) => (value ? 'ignores lights' : 'obeys lights'));
  add('late_yielder', (value) => (value ? 'yields late' : 'yields in time'));
  return said.join(', ');
}

function lanelets(ids: number[] | undefined) {
  if (!ids?.length) {
    return 'all roads';
  }
  return `${ids.length === 1 ? 'lanelet' : 'lanelets'} ${ids.join(', ')}`;
}

/**
 * @param spec of a planner or a driver
 * @returns the same with the name instead of the path of a file in it
 */
export function baseName(spec: string | null | undefined): string {
  return String(spec ?? '').replace(/(?:[^\s:]*\/)+/g, '');
}
