// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A notice for a driver whose request to be put back on the lane had no effect. */

import type { FiredEvent } from '../messages.js';
import type { Store } from '../store.js';

// Time after which the request has failed: a vehicle is put back within a step, but the event
// takes longer to reach the page [ms].
const IN_VAIN_MS = 1000;
const IN_VAIN = 'Not put back: no place is free on the lane, or the contact is more than '
  + '20 m away. Keep Backspace held until there is one.';

/** The watch; one per page. */
export class PutBackNotice {
  #store;
  #timer = 0;
  #asked = false;

  constructor(store: Store) {
    this.#store = store;
  }

  /**
   * Update with the driver's input; holding the control requests once.
   * @param asked whether the driver requests to be put back
   */
  update(seat: string | null, asked: boolean) {
    const begins = asked && !this.#asked;
    this.#asked = asked;
    if (begins && seat !== null && standsAtContact(this.#store.fired, seat)) {
      clearTimeout(this.#timer);
      this.#timer = setTimeout(() => this.#warn(seat), IN_VAIN_MS);
    }
  }

  #warn(seat: string) {
    const { fired, status } = this.#store;
    if (status?.run === 'running' && standsAtContact(fired, seat)) {
      this.#store.receive({ type: 'notice', level: 'warn', text: IN_VAIN });
    }
  }
}

/** @returns whether a contact has stopped the vehicle, and it was not put back since */
function standsAtContact(fired: FiredEvent[], seat: string): boolean {
  const last = fired.findLast(({ by, name }) => (by === 'contact'
    ? name.split(' ')[2] === seat : by === 'driver' && name.endsWith(` ${seat}`)));
  return last?.by === 'contact';
}
