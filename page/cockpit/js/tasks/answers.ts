// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The inputs by which a driver answers: a key and a button for each kind of task, touch. */

import { isCommand } from '../driving/focus.js';
import { connectedPads } from '../driving/gamepad.js';
import { LIGHT_BUTTONS } from '../lights.js';

import type { Profile } from '../driving/gamepad_profile.js';

/** What can be answered: a light, or a request to take over. */
export type Answered = 'light' | 'request';
/** The inputs of one of them; `button` is null for the usual ones. */
export interface AnswerInput { key: string; button: number | null }
/** The inputs of a page's driver; without lights or requests, those are missing. */
export type AnswerInputs = Partial<Record<Answered, AnswerInput>>;

// An older time stamp of a gamepad does not belong to the press just seen [ms].
const FRESH_MS = 200;

/** Return whether a button has another meaning; `profile` of its device; `index` of the button. */
export function isTaken(profile: Profile, index: number): boolean {
  const { reverse, lights, put_back } = profile;
  return [reverse.on, reverse.off, reverse.toggle, reverse.held,
    put_back, ...LIGHT_BUTTONS.map((name) => lights[name])].some((list) => list.includes(index))
    || [profile.throttle, profile.brake, profile.steering].some(
      (control) => control.kind === 'button' && control.index === index);
}

/**
 * Return what a button answers. By default any free button answers a request, and any a light; a
 * driver who may get both answers lights by the first free one.
 * @param profile of its device
 * @param index of the button
 * @returns null for nothing
 */
export function answeredBy(inputs: AnswerInputs, profile: Profile, index: number):
    Answered | null {
  if (isTaken(profile, index)) {
    return null;
  }
  const { light, request } = inputs;
  const first = [...Array(index + 1).keys()].find((each) => !isTaken(profile, each)
    && each !== request?.button);
  const forLight = light !== undefined && (light.button === null
    ? (request === undefined || index === first) && index !== request?.button
    : index === light.button);
  if (forLight) {
    return 'light';
  }
  return request !== undefined && (request.button === null || request.button === index)
    ? 'request' : null;
}

/** @returns a key's name for people: `T` for KeyT */
export function keyName(key: string): string {
  return key.replace(/^(Key|Digit)/, '').replace(/^Numpad(?=.)/, 'Numpad ');
}

/** A listener that is active while answers are accepted. */
export class Answers {
  #inputs;
  #wanted;
  #take;
  #pressed = new Map<number, boolean[]>();
  #polling = false;

  /**
   * @param inputs returns what the driver may have to answer in this run
   * @param wanted returns whether an answer is accepted now
   * @param take called with what is answered, and when, by performance.now
   */
  constructor(inputs: () => AnswerInputs, wanted: (what: Answered) => boolean,
    take: (what: Answered, at_ms: number) => void) {
    this.#inputs = inputs;
    this.#wanted = wanted;
    this.#take = take;
    window.addEventListener('keydown', (event) => this.#key(event), true);
  }

  /** Accept a touch or click on an element as the answer to a light. */
  touch(node: HTMLElement) {
    node.addEventListener('pointerdown', (event) => {
      if (this.#wanted('light')) {
        event.preventDefault();
        this.#take('light', event.timeStamp);
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
    const inputs = this.#inputs();
    const what = (['light', 'request'] as const).find((each) => inputs[each]?.key === event.code
      || (inputs[each]?.key === 'Enter' && event.key === 'Enter'));
    if (isCommand(event) && what !== undefined && this.#wanted(what)) {
      event.preventDefault();
      event.stopPropagation();
      if (!event.repeat) {
        this.#take(what, event.timeStamp);
      }
    }
  }

  #poll() {
    this.#polling = this.#wanted('light') || this.#wanted('request');
    const now_ms = performance.now();
    const inputs = this.#inputs();
    for (const pad of connectedPads()) {
      const device = window.crgame.driving?.gamepads.devices.find(
        ({ index }) => index === pad.index);
      const before = this.#pressed.get(pad.index);
      const pressed = pad.buttons.map((button) => button.pressed);
      this.#pressed.set(pad.index, pressed);
      // The first poll cannot tell which buttons are newly pressed.
      if (before === undefined || device === undefined) {
        continue;
      }
      const age_ms = now_ms - pad.timestamp;
      const at_ms = age_ms >= 0 && age_ms < FRESH_MS ? pad.timestamp : now_ms;
      const answered = pressed.map((down, i) => (down && !before[i]
        ? answeredBy(inputs, device.profile, i) : null));
      for (const what of ['light', 'request'] as const) {
        if (answered.includes(what) && this.#wanted(what)) {
          this.#take(what, at_ms);
        }
      }
    }
    if (this.#polling) {
      requestAnimationFrame(() => this.#poll());
    }
  }
}
