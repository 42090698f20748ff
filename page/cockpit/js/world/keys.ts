// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Keys of the world; the driving keys (W A S D, arrows, space, R) are not among them. */

import { isCommand } from '../driving/focus.js';

import type { WorldActions } from './toolbar.js';

const ZOOM_STEP = 1.25;
const TURN_STEP = Math.PI / 12;

/** Make keys move the camera; return a function that ends it. */
export function attachKeys(actions: WorldActions): () => void {
  const bindings: Record<string, (() => void) | undefined> = {
    '+': () => actions.zoomBy(ZOOM_STEP),
    '=': () => actions.zoomBy(ZOOM_STEP),
    '-': () => actions.zoomBy(1 / ZOOM_STEP),
    0: () => actions.fit(),
    f: () => actions.followNext(),
    h: () => actions.toggleHeading(),
    q: () => actions.turnBy(TURN_STEP),
    e: () => actions.turnBy(-TURN_STEP),
    l: () => actions.toggleLabels(),
  };
  const pressed = (event: KeyboardEvent) => {
    if (!isCommand(event)) {
      return;
    }
    const action = bindings[event.key.toLowerCase()];
    if (action !== undefined) {
      event.preventDefault();
      action();
    }
  };
  window.addEventListener('keydown', pressed);
  return () => window.removeEventListener('keydown', pressed);
}
