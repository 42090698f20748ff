// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Drawn icons of the run control. */

import { svg } from '../dom.js';

import type { RunAction } from '../messages.js';

const PATHS: Record<RunAction, string> = {
  start: 'M6 4 L20 12 L6 20 Z',
  pause: 'M6 4 H10 V20 H6 Z M14 4 H18 V20 H14 Z',
  step: 'M4 4 L15 12 L4 20 Z M17 4 H20 V20 H17 Z',
  reset: 'M12 4 A8 8 0 1 1 4.6 9 L7.4 10.1 A5 5 0 1 0 12 7 V10 L6.5 5.5 L12 1 Z',
  stop: 'M5 5 H19 V19 H5 Z',
};

/**
 * Draw an icon in the colour of the text around it.
 * @param name one of start, pause, step, reset and stop
 */
export function icon(name: RunAction): SVGElement {
  return svg('svg', { class: 'icon', viewBox: '0 0 24 24', 'aria-hidden': 'true' },
    svg('path', { d: PATHS[name] }));
}
