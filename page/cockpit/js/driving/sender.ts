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
    // A release is sent once: silence then means the same.
    setInterval(() => this.#send((input) => !('away' in input)), REPEAT_MS);
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
    this.#send((_, text) => text !== this.#last);
  }

  /** @param wanted whether inputs, also as text, are sent */
  #send(wanted: (input: Hands, text: string) => boolean) {
    if (this.#seat === null) {
      return;
    }
    const input = this.#hands();
    const text = JSON.stringify(input);
    if (wanted(input, text)) {
      this.#last = text;
      this.#connection.send({ type: 'input', seat: this.#seat, ...input });
    }
  }
}
