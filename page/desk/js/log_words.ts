// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Journal entries as one line each. */

import type { LogEntry } from './experimenter_messages.js';

/** Return an entry as text. */
export function entryWords(entry: LogEntry): string {
  const { entry: kind, item, time_s, run, ...rest } = entry;
  const clock = typeof time_s === 'number' ? ` at ${time_s.toFixed(1)} s of ${run}` : '';
  const of = typeof item === 'string' && item ? ` ${item}` : '';
  switch (kind) {
    case 'note': return `note${clock}: ${rest.text}`;
    case 'marker': return `marker${clock}: ${rest.name}`;
    case 'language': return `language: ${rest.language}`;
    case 'held': return rest.held ? 'held before the next item' : 'goes on';
    case 'begun': return 'session begun';
    case 'allocated': return `group ${rest.group}, place ${Number(rest.place) + 1} in it`;
    case 'ended': return `session ended: ${rest.reason}`;
    case 'started': return `started${of}, attempt ${rest.attempt}${run ? `, ${run}` : ''}`;
    case 'practised': return `practised${of}: ${rest.good ? 'good' : 'not good'}`;
    default: {
      const why = rest.reason ?? rest.outcome;
      return `${kind}${of}${why === undefined ? '' : `: ${why}`}`;
    }
  }
}

/**
 * Return the time of day.
 *
 * @param at seconds since 1970
 */
export function timeOfDay(at: number): string {
  return new Date(1000 * at).toLocaleTimeString('en-GB');
}
