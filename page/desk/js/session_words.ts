// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Items of a session, what their drives leave in doubt, and journal entries, as text. */

import type { Doubt, ItemRow, LogEntry } from './experimenter_messages.js';
import type { Words } from './words.js';

/** Return the kind of an item and which one of its kind it is. */
export function kindWords({ kind, what }: Pick<ItemRow, 'kind' | 'what'>, words: Words): string {
  return words.of(`kind_${kind}`, {
    what: kind === 'break' ? words.number(Number(what)) : what });
}

/** Return the state of an item and how it ended; a typed reason stays as it is. */
export function stateWords({ state, outcome, reason, doubts }: ItemRow, words: Words): string {
  const end = [outcome ? words.of(`outcome_${outcome}`) : reason,
    ...doubts.map((doubt) => doubtWords(doubt, words))].filter((text) => text !== '');
  return [words.of(`state_${state}`), ...end.length > 0 ? [end.join('; ')] : []].join(': ');
}

/** Return a value that is beyond its bound, and the bound. */
export function doubtWords({ check, value, bound, unit, digits, least }: Doubt,
  words: Words): string {
  const suffix = unit === '' ? '' : ` ${unit}`;
  return words.of(least ? 'desk_doubt_least' : 'desk_doubt_most', {
    what: words.of(`check_${check}`), value: `${words.number(value, digits)}${suffix}`,
    bound: `${words.number(bound)}${suffix}` });
}

/** Return an entry as text; what people typed, and reasons, stay as they are in the journal. */
export function entryWords(entry: LogEntry, words: Words): string {
  const { entry: kind, item, time_s, run, ...rest } = entry;
  const clock = typeof time_s === 'number'
    ? ` ${words.of('log_at', { seconds: words.number(time_s, 1), run: `${run}` })}` : '';
  // Some entries are of no item.
  const what = words.of(`log_${kind}`, { item: typeof item === 'string' ? item : '' }).trim();
  switch (kind) {
    case 'note': return `${what}${clock}: ${rest.text}`;
    case 'marker': return `${what}${clock}: ${rest.name}`;
    case 'language': return `${what}: ${rest.language}`;
    case 'held': return words.of(rest.held ? 'log_held' : 'log_released');
    case 'allocated': return words.of('log_allocated', {
      group: `${rest.group}`, place: Number(rest.place) + 1 });
    case 'started': return [what, words.of('desk_attempt', { attempt: Number(rest.attempt) }),
      ...run ? [`${run}`] : []].join(', ');
    case 'practised':
      return `${what}: ${words.of(rest.good ? 'log_practised_good' : 'log_practised_bad')}`;
    default: {
      const why = rest.reason ?? (rest.outcome ? words.of(`outcome_${rest.outcome}`) : undefined);
      return `${what}${why === undefined ? '' : `: ${why}`}`;
    }
  }
}

/** Return the time of day; `at`: seconds since 1970. */
export function timeOfDay(at: number): string {
  return new Date(1000 * at).toLocaleTimeString('en-GB');
}
