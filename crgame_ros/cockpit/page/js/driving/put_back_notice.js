// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Tells a driver who asks to be put back on the lane that nothing has come of it. */

/** @import { FiredEvent } from '../messages.js' */
/** @import { Store } from '../store.js' */

// A vehicle is put back within a step; the event's way to the page takes longer [ms].
const IN_VAIN_MS = 1000;
export const IN_VAIN = 'Not put back: no place is free on the lane, or the contact is more than '
  + '20 m away. Keep Backspace held until there is one.';

/** The watch; one per page. */
export class PutBackNotice {
  #store;
  #timer = 0;
  #asked = false;

  /** @param {Store} store */
  constructor(store) {
    this.#store = store;
  }

  /**
   * Take what the hands do; holding on asks once.
   *
   * @param {string|null} seat
   * @param {boolean} asked whether the vehicle is to be put back
   */
  take(seat, asked) {
    const begins = asked && !this.#asked;
    this.#asked = asked;
    if (begins && seat !== null && standsAtContact(this.#store.fired, seat)) {
      clearTimeout(this.#timer);
      this.#timer = setTimeout(() => this.#look(seat), IN_VAIN_MS);
    }
  }

  /** @param {string} seat */
  #look(seat) {
    const { fired, status } = this.#store;
    if (status?.run === 'running' && standsAtContact(fired, seat)) {
      this.#store.receive({ type: 'notice', level: 'warn', text: IN_VAIN });
    }
  }
}

/**
 * @param {FiredEvent[]} fired
 * @param {string} seat
 * @returns {boolean} whether a contact has stopped the vehicle, and it was not put back since
 */
export function standsAtContact(fired, seat) {
  const last = fired.findLast(({ by, name }) => (by === 'contact'
    ? name.split(' ')[2] === seat : by === 'driver' && name.endsWith(` ${seat}`)));
  return last?.by === 'contact';
}
