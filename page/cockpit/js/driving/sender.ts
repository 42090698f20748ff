// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The sender of the driver's inputs for the held seat: at each change and periodically. */

import type { Connection } from '../connection.js';
import type { Hands } from '../messages.js';

// The server releases the controls after 200 ms of silence.
const REPEAT_MS = 50;

/** The stream of input messages of one seat. */
export class InputSender {
  #connection;
  #hands;
  #seat: string | null = null;
  #last = '';

  /** @param hands returns the current inputs */
  constructor(connection: Connection, hands: () => Hands) {
    this.#connection = connection;
    this.#hands = hands;
    setInterval(() => this.#repeat(), REPEAT_MS);
  }

  /** @returns the seat that receives the inputs */
  get seat(): string | null {
    return this.#seat;
  }

  /** @param seat the seat that is held from now on, or null */
  set seat(seat: string | null) {
    if (seat !== this.#seat) {
      this.#seat = seat;
      this.#last = '';
      this.update();
    }
  }

  /** Send at once if the inputs have changed. */
  update() {
    if (this.#seat === null) {
      return;
    }
    const input = this.#hands();
    const text = JSON.stringify(input);
    if (text !== this.#last) {
      this.#last = text;
      this.#send(this.#seat, input);
    }
  }

  #repeat() {
    if (this.#seat === null) {
      return;
    }
    const input = this.#hands();
    // A release is sent once: silence then means the same.
    if (!('away' in input)) {
      this.#last = JSON.stringify(input);
      this.#send(this.#seat, input);
    }
  }

  #send(seat: string, input: Hands) {
    this.#connection.send({ type: 'input', seat, ...input });
  }
}
