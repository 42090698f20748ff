// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The inputs by which a driver answers: Enter, a free button of gamepad or wheel, touch. */

import { isTyping } from '../driving/focus.js';
import { connectedPads } from '../driving/gamepad.js';
import { LIGHT_BUTTONS } from '../lights.js';

import type { Profile } from '../driving/gamepad_profile.js';

export const ANSWER_KEY = 'Enter';
// An older time stamp of a gamepad does not belong to the press just seen [ms].
const FRESH_MS = 200;

/**
 * Return whether a button has another meaning.
 *
 * @param profile of its device
 * @param index of the button
 */
export function isTaken(profile: Profile, index: number): boolean {
  const { reverse, lights, put_back } = profile;
  return [reverse.on, reverse.off, reverse.toggle, reverse.held,
    put_back, ...LIGHT_BUTTONS.map((name) => lights[name])].some((list) => list.includes(index))
    || [profile.throttle, profile.brake, profile.steering].some(
      (control) => control.kind === 'button' && control.index === index);
}

/** A listener that is active while answers are accepted. */
export class Answers {
  #wanted;
  #take;
  #pressed = new Map<number, boolean[]>();
  #polling = false;

  /**
   * @param wanted returns whether an answer is accepted now
   * @param take called with the time of an answer, by performance.now
   */
  constructor(wanted: () => boolean, take: (at_ms: number) => void) {
    this.#wanted = wanted;
    this.#take = take;
    window.addEventListener('keydown', (event) => this.#key(event), true);
  }

  /** Accept a touch or click on an element as an answer. */
  touch(node: HTMLElement) {
    node.addEventListener('pointerdown', (event) => {
      if (this.#wanted()) {
        event.preventDefault();
        this.#take(event.timeStamp);
      }
    });
  }

  /** Poll the buttons of gamepads in every frame while answers are accepted. */
  watch() {
    if (!this.#polling) {
      this.#polling = true;
      this.#pressed.clear();
      requestAnimationFrame(() => this.#poll());
    }
  }

  #key(event: KeyboardEvent) {
    const free = !event.ctrlKey && !event.metaKey && !event.altKey && !isTyping(event.target)
      && !document.querySelector('dialog[open]');
    if (event.key === ANSWER_KEY && free && this.#wanted()) {
      event.preventDefault();
      event.stopPropagation();
      if (!event.repeat) {
        this.#take(event.timeStamp);
      }
    }
  }

  #poll() {
    this.#polling = this.#wanted();
    const now_ms = performance.now();
    for (const pad of connectedPads()) {
      const device = window.crgame.driving?.gamepads.devices.find(
        ({ index }) => index === pad.index);
      const before = this.#pressed.get(pad.index);
      const pressed = pad.buttons.map((button) => button.pressed);
      this.#pressed.set(pad.index, pressed);
      // The first poll cannot tell which buttons are newly pressed.
      const fresh = before !== undefined && device !== undefined && pressed.some(
        (down, i) => down && !before[i] && !isTaken(device.profile, i));
      if (fresh && this.#polling) {
        const age_ms = now_ms - pad.timestamp;
        this.#take(age_ms >= 0 && age_ms < FRESH_MS ? pad.timestamp : now_ms);
      }
    }
    if (this.#polling) {
      requestAnimationFrame(() => this.#poll());
    }
  }
}
