// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The raw driving keys: the held keys, and each tap of the gear key. */

import { HELD_MS } from '../after/restart_key.js';
import { LIGHT_BUTTONS } from '../lights.js';
import { isCommand, isTyping } from './focus.js';

export type KeyAction = 'throttle' | 'brake' | 'left' | 'right' | 'reverse' | 'put_back'
  | typeof LIGHT_BUTTONS[number];

/** The function of each key by its place on the keyboard, so that every layout drives alike. */
export const ACTIONS = Object.freeze({
  KeyW: 'throttle', ArrowUp: 'throttle',
  KeyS: 'brake', ArrowDown: 'brake', Space: 'brake',
  KeyA: 'left', ArrowLeft: 'left',
  KeyD: 'right', ArrowRight: 'right',
  KeyR: 'reverse', Backspace: 'put_back',
  Comma: 'left_indicator', Period: 'right_indicator', KeyJ: 'hazard', KeyG: 'horn',
} as Record<string, KeyAction | undefined>);

const ORDER: KeyAction[] = ['throttle', 'brake', 'left', 'right'];

/** A listener to the driving keys while `enabled` returns true. */
export class Keyboard {
  #enabled;
  #report;
  #held = new Set<string>();
  // Time at which R was pressed [ms]. A tap is reported at release, because holding R restarts.
  #reverseSince_ms = NaN;

  /**
   * @param enabled whether keys drive now
   * @param report `changed` at each change of the held keys, `reversed` at each tap on R
   */
  constructor(enabled: () => boolean, report: { changed: () => void; reversed: () => void }) {
    this.#enabled = enabled;
    this.#report = report;
    // The capture phase precedes any widget, so that a focused button does not take the space bar.
    window.addEventListener('keydown', (event) => this.#down(event), true);
    window.addEventListener('keyup', (event) => this.#up(event), true);
    document.addEventListener('focusin', (event) => {
      if (isTyping(event.target)) {
        this.release();
      }
    });
  }

  /** @returns throttle, brake, left, right: 1 while a key of it is held */
  get keys(): number[] {
    return this.#active(ORDER);
  }

  /** @returns left and right indicator, hazard, horn: 1 while a key of it is held */
  get lights(): number[] {
    return this.#active(LIGHT_BUTTONS);
  }

  /** @returns whether the vehicle is to be put back on its lane */
  get putBack(): boolean {
    return this.#active(['put_back'])[0] === 1;
  }

  /** @returns whether any key that steers or moves a pedal is held */
  get anyHeld(): boolean {
    return this.keys.includes(1);
  }

  /** Return whether a key is held; `code`: its place, such as 'KeyW'. */
  isHeld(code: string): boolean {
    return this.#held.has(code);
  }

  /** Press a key by touch; `code`: place of a key. */
  press(code: string) {
    if (this.#enabled()) {
      this.#press(code, performance.now());
    }
  }

  /** Release a key that `press` has pressed; `code`: place of a key. */
  lift(code: string) {
    this.#leave(code, performance.now());
  }

  /** Release all keys; a key that is still down must be pressed again. */
  release() {
    this.#reverseSince_ms = NaN;
    if (this.#held.size > 0) {
      this.#held.clear();
      this.#report.changed();
    }
  }

  #active(actions: readonly KeyAction[]) {
    const active = new Set([...this.#held].map((code) => ACTIONS[code]));
    return actions.map((action) => Number(active.has(action)));
  }

  #down(event: KeyboardEvent) {
    // While the command key is held, macOS reports no key releases.
    if (event.key === 'Meta') {
      this.release();
      return;
    }
    const action = ACTIONS[event.code];
    if (!action || event.isComposing || !isCommand(event) || !this.#enabled()) {
      return;
    }
    event.preventDefault();
    event.stopPropagation();
    if (event.repeat) {
      return;
    }
    this.#press(event.code, event.timeStamp);
  }

  #press(code: string, now_ms: number) {
    if (ACTIONS[code] === 'reverse') {
      this.#reverseSince_ms = now_ms;
    } else if (!this.#held.has(code)) {
      this.#held.add(code);
      this.#report.changed();
    }
  }

  /** @returns whether it was held */
  #leave(code: string, now_ms: number): boolean {
    if (ACTIONS[code] === 'reverse') {
      if (now_ms - this.#reverseSince_ms < HELD_MS) {
        this.#report.reversed();
      }
      this.#reverseSince_ms = NaN;
    }
    const held = this.#held.delete(code);
    if (held) {
      this.#report.changed();
    }
    return held;
  }

  #up(event: KeyboardEvent) {
    if (this.#leave(event.code, event.timeStamp)) {
      // Firefox activates a focused button when the space bar is released.
      event.preventDefault();
      event.stopPropagation();
    }
  }
}
