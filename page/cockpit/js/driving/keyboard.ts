// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The raw driving keys: the held keys, and each tap of the gear key. */

import { HELD_MS } from '../after/restart_key.js';
import { LIGHT_BUTTONS } from '../lights.js';
import { isTyping } from './focus.js';

/**
 * @typedef {'throttle'|'brake'|'left'|'right'|'reverse'|'put_back'
 *   |typeof LIGHT_BUTTONS[number]} KeyAction
 */

/** The function of each key by its place on the keyboard, so that every layout drives alike. */
export const ACTIONS = Object.freeze(/** @type {Record<string, KeyAction|undefined>} */ ({
  KeyW: 'throttle', ArrowUp: 'throttle',
  KeyS: 'brake', ArrowDown: 'brake', Space: 'brake',
  KeyA: 'left', ArrowLeft: 'left',
  KeyD: 'right', ArrowRight: 'right',
  KeyR: 'reverse', Backspace: 'put_back',
  Comma: 'left_indicator', Period: 'right_indicator', KeyJ: 'hazard', KeyG: 'horn',
}));

/** @type {KeyAction[]} */
const ORDER = ['throttle', 'brake', 'left', 'right'];

/** A listener to the driving keys while `enabled` returns true. */
export class Keyboard {
  #enabled;
  #report;
  /** @type {Set<string>} */
  #held = new Set();
  // Time at which R was pressed [ms]. A tap is reported at release, because holding R restarts.
  #reverseSince_ms = NaN;

  /**
   * @param {() => boolean} enabled whether keys drive now
   * @param {{changed: () => void, reversed: () => void}} report `changed` at each change of the
   *   held keys, `reversed` at each tap on R
   */
  constructor(enabled, report) {
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

  /** @returns {number[]} throttle, brake, left, right: 1 while a key of it is held */
  get keys() {
    return this.#active(ORDER);
  }

  /** @returns {number[]} left and right indicator, hazard, horn: 1 while a key of it is held */
  get lights() {
    return this.#active(LIGHT_BUTTONS);
  }

  /** @returns {boolean} whether the vehicle is to be put back on its lane */
  get putBack() {
    return this.#active(['put_back'])[0] === 1;
  }

  /** @returns {boolean} whether any key that steers or moves a pedal is held */
  get anyHeld() {
    return this.keys.includes(1);
  }

  /**
   * @param {string} code place of a key, such as 'KeyW'
   * @returns {boolean} whether it is held
   */
  isHeld(code) {
    return this.#held.has(code);
  }

  /**
   * Press a key by touch.
   *
   * @param {string} code place of a key
   */
  press(code) {
    if (this.#enabled()) {
      this.#press(code, performance.now());
    }
  }

  /**
   * Release a key that `press` has pressed.
   *
   * @param {string} code place of a key
   */
  lift(code) {
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

  /** @param {readonly KeyAction[]} actions */
  #active(actions) {
    const active = new Set([...this.#held].map((code) => ACTIONS[code]));
    return actions.map((action) => Number(active.has(action)));
  }

  /** @param {KeyboardEvent} event */
  #down(event) {
    // While the command key is held, macOS reports no key releases.
    if (event.key === 'Meta') {
      this.release();
      return;
    }
    const action = ACTIONS[event.code];
    if (!action || event.ctrlKey || event.metaKey || event.altKey || event.isComposing
        || isTyping(event.target) || !this.#enabled()) {
      return;
    }
    event.preventDefault();
    event.stopPropagation();
    if (event.repeat) {
      return;
    }
    this.#press(event.code, event.timeStamp);
  }

  /**
   * @param {string} code
   * @param {number} now_ms
   */
  #press(code, now_ms) {
    if (ACTIONS[code] === 'reverse') {
      this.#reverseSince_ms = now_ms;
    } else if (!this.#held.has(code)) {
      this.#held.add(code);
      this.#report.changed();
    }
  }

  /**
   * @param {string} code
   * @param {number} now_ms
   * @returns {boolean} whether it was held
   */
  #leave(code, now_ms) {
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

  /** @param {KeyboardEvent} event */
  #up(event) {
    if (this.#leave(event.code, event.timeStamp)) {
      // Firefox activates a focused button when the space bar is released.
      event.preventDefault();
      event.stopPropagation();
    }
  }
}
