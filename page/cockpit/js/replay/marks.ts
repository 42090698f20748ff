// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Marks of events on the time line; each kind has its own shape and colour. */

import { element, svg } from '../dom.js';

import type { ReplayMark } from '../api_messages.js';

// Shapes on a 12 x 12 grid and the name of each kind; the colours are in replay.css.
const KINDS = new Map<string, [shape: string, word: string]>([
  ['collision', ['M6 0L7.6 4.4 12 6 7.6 7.6 6 12 4.4 7.6 0 6 4.4 4.4Z', 'Collision']],
  ['off_road', ['M6 1L12 11H0Z', 'Off the road']],
  ['stale_plan', ['M1 1H11V11H1Z', 'No plan']],
  ['refused_plan', ['M2 0L6 4 10 0 12 2 8 6 12 10 10 12 6 8 2 12 0 10 4 6 0 2Z', 'Plan refused']],
  ['fallback', ['M0 1H12L6 11Z', 'Planner failed']],
  ['lost_device', ['M6 0L12 4.6 9.7 12H2.3L0 4.6Z', 'Driver lost']],
  ['trigger', ['M6 0L12 6 6 12 0 6Z', 'Event']],
  ['stop', ['M3.5 0H8.5L12 3.5V8.5L8.5 12H3.5L0 8.5V3.5Z', 'Stopped']],
  ['late', ['M1 0H11L7 6 11 12H1L5 6Z', 'Late']],
  ['late_traffic', ['M0 7L3 2H9L12 7V10H0Z', 'Traffic late']],
  ['reset', ['M6 0A6 6 0 1 1 5.9 0ZM6 3A3 3 0 1 0 6.1 3Z', 'Clock reset']],
  ['recording', ['M6 0A6 6 0 1 1 5.9 0Z', 'Recording failed']],
  ['gap', ['M1 0H4.5V12H1ZM7.5 0H11V12H7.5Z', 'Not recorded']],
]);
const OTHER: [shape: string, word: string] = ['M4 0H8V12H4Z', ''];

/** Return an event's time, kind, subject, text and count as text. */
export function eventText({ kind, subject, text, count, t }: ReplayMark): string {
  const [, word] = KINDS.get(kind) ?? OTHER;
  const head = `${word || kind.replaceAll('_', ' ')}${subject ? ` (${subject})` : ''}`;
  const times = count > 1 ? `, ${count} times` : '';
  return `${t.toFixed(2)} s  ${head}${text ? `: ${text}` : ''}${times}`;
}

/** Draw the mark of an event; `share`: where on the time line, 0 to 1. */
export function mark(event: ReplayMark, share: number, chosen: () => void): HTMLElement {
  const [shape] = KINDS.get(event.kind) ?? OTHER;
  // Not in the tab order: [ and ] lead from one to the next.
  const node = element('button', {
    type: 'button', class: 'mark', tabindex: -1, 'data-kind': event.kind,
    title: eventText(event), 'aria-label': eventText(event), on: { click: chosen },
  }, svg('svg', { viewBox: '-1 -1 14 14', 'aria-hidden': 'true' },
    svg('path', { d: shape, 'fill-rule': 'evenodd' })));
  node.style.setProperty('--share', String(share));
  return node;
}
