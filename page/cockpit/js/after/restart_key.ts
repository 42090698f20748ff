// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The R key: holding it restarts the run, tapping it selects the reverse gear. */

import { element, setAttribute, setText } from '../dom.js';
import { isCommand } from '../driving/focus.js';
import { reasonAgainstOrder, tellRefusal } from '../rights.js';

import type { Connection } from '../connection.js';
import type { Store } from '../store.js';

/** How long the key is held until the run restarts [ms]. */
export const HELD_MS = 800;
// A shorter press is a tap and shows no hint [ms].
const SHOWN_AFTER_MS = 250;
const KEY = 'KeyR';
const HINT = 'Hold R to begin anew';

/** Listen to the key, which counts while `held`; `root` gets the hint. */
export function createRestart(root: HTMLElement, store: Store,
  connection: Connection): { held: boolean } {
  const state = { held: false };
  const hint = element('div', { class: 'restart-hint', role: 'status', hidden: true });
  root.append(hint);
  let timers: number[] = [];
  const end = () => {
    timers.forEach(clearTimeout);
    timers = [];
    state.held = false;
    setAttribute(hint, 'hidden', true);
  };
  const restart = () => {
    end();
    tellRefusal(store, connection.request({ type: 'control', action: 'reset' }));
  };
  window.addEventListener('keydown', (event) => {
    if (event.code !== KEY || event.repeat || !isCommand(event)
        || store.mode !== 'live' || !store.connected || store.status === null) {
      return;
    }
    end();
    state.held = true;
    const reason = reasonAgainstOrder(store, 'reset');
    setText(hint, reason || HINT);
    setAttribute(hint, 'data-refused', reason !== '');
    timers = [setTimeout(() => setAttribute(hint, 'hidden', false), SHOWN_AFTER_MS)];
    if (reason === '') {
      timers.push(setTimeout(restart, HELD_MS));
    }
  }, true);
  window.addEventListener('keyup', (event) => event.code === KEY && end(), true);
  window.addEventListener('blur', end);
  return state;
}
