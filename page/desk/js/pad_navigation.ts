// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Answering with the buttons of a gamepad or wheel: next and previous option, confirm. */

import { connectedPads } from '../../cockpit/js/driving/gamepad.js';

export type PadOrder = 'previous' | 'next' | 'up' | 'down' | 'confirm';

// Of the standard mapping: arrows, shoulder buttons, the lowest of the four.
const STANDARD: Record<number, PadOrder> = {
  14: 'previous', 15: 'next', 12: 'up', 13: 'down', 4: 'previous', 5: 'next', 0: 'confirm' };
// Wheels: paddles, and the first two buttons.
const WHEEL: Record<number, PadOrder> = {
  5: 'previous', 4: 'next', 0: 'confirm', 1: 'up' };
const STOPS = '.question, button:not([disabled]):not([hidden])';

/** Listens while anything but a drive is shown. */
export class PadNavigation {
  #sheet;
  #drive;
  #pressed = new Map<number, boolean[]>();
  #frame = 0;

  /** `sheet`: the element with the questions; `drive`: the gate before a drive. */
  constructor(sheet: HTMLElement, drive: HTMLElement) {
    this.#sheet = sheet;
    this.#drive = drive;
    window.addEventListener('gamepadconnected', () => this.#poll());
    if (connectedPads().length > 0) {
      this.#poll();
    }
  }

  #poll() {
    const pads = connectedPads();
    for (const pad of pads) {
      const before = this.#pressed.get(pad.index);
      const now = pad.buttons.map(({ pressed }) => pressed);
      this.#pressed.set(pad.index, now);
      now.forEach((pressed, i) => {
        const order = (pad.mapping === 'standard' ? STANDARD : WHEEL)[i];
        // The press that made the pad appear does not count as an order.
        if (pressed && before && !before[i] && order) {
          this.#apply(order);
        }
      });
    }
    if (pads.length > 0) {
      cancelAnimationFrame(this.#frame);
      this.#frame = requestAnimationFrame(() => this.#poll());
    }
  }

  #apply(order: PadOrder) {
    const root = this.#drive.hidden ? this.#sheet : this.#drive;
    if (document.querySelector('dialog[open]')
        || root.querySelector('.device-check:not([data-complete])')) {
      return;
    }
    const stops = [...root.querySelectorAll(STOPS)].filter(
      (stop) => stop instanceof HTMLElement && stop.offsetParent !== null);
    const { activeElement: focused } = document;
    const at = stops.findIndex((stop) => stop.contains(focused));
    const stop = stops[at];
    if (stop === undefined) {
      enter(stops[0]);
    } else if (order === 'confirm') {
      confirm(stop, focused, stops[at + 1]);
    } else if (order === 'up' || order === 'down') {
      enter(stops[at + (order === 'up' ? -1 : 1)]);
    } else if (stop.matches('button')) {
      enter(stops[at + (order === 'next' ? 1 : -1)]);
    } else {
      change(stop, focused, order === 'next' ? 1 : -1, stops[at + 1]);
    }
  }
}

function enter(stop: Element | undefined) {
  const target = stop?.matches('button') ? stop
    : stop?.querySelector('input:checked') ?? stop?.querySelector('input, textarea');
  if (target instanceof HTMLElement) {
    target.focus();
    stop?.scrollIntoView({ block: 'nearest' });
  }
}

function confirm(stop: Element, focused: Element | null, following: Element | undefined) {
  if (focused instanceof HTMLInputElement && focused.type === 'checkbox') {
    focused.click();
  } else if (focused instanceof HTMLInputElement && focused.type === 'radio'
      && !stop.querySelector('input:checked')) {
    focused.click();
  } else if (stop instanceof HTMLButtonElement) {
    stop.click();
  } else {
    enter(following);
  }
}

function change(stop: Element, focused: Element | null, by: 1 | -1,
  following: Element | undefined) {
  const inputs = [...stop.querySelectorAll('input')];
  if (!(focused instanceof HTMLInputElement)) {
    return;
  }
  if (focused.type === 'range') {
    (by > 0 ? focused.stepUp : focused.stepDown).call(focused);
    focused.dispatchEvent(new Event('input', { bubbles: true }));
    return;
  }
  const chosen = stop.querySelector('input:checked') !== null;
  const place = inputs.indexOf(focused);
  if (focused.type === 'checkbox' && by > 0 && place === inputs.length - 1) {
    // A wheel has no other way on: confirming checks the box.
    enter(following);
    return;
  }
  const next = inputs[focused.type === 'radio' && !chosen ? place
    : Math.min(Math.max(place + by, 0), inputs.length - 1)];
  next.focus();
  if (next.type === 'radio') {
    next.click();
  }
}
