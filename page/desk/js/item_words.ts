// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Items of a session, and what their drives leave in doubt, as text. */

import type { Doubt, ItemRow } from './experimenter_messages.js';
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
