// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A bounded ring of received samples in the order of their simulation time. */

import { countWhile } from './search.js';

/** Samples {n, t, …}, oldest first; a new one beyond the capacity replaces the oldest. */
export class SampleRing<Sample extends { n: number; t: number }> {
  #items: Sample[] = [];
  #capacity;
  #spacing_s;

  /**
   * @param capacity how many samples are kept
   * @param spacing_s samples that follow within this time are left out [s]
   */
  constructor(capacity: number, spacing_s = 0) {
    this.#capacity = capacity;
    this.#spacing_s = spacing_s;
  }

  /** Return how many samples there are. */
  get length() {
    return this.#items.length;
  }

  /** Return the newest sample, undefined if there is none. */
  get newest() {
    return this.#items.at(-1);
  }

  /** Return a sample, undefined if there is none; 0 is the oldest. */
  at(index: number): Sample | undefined {
    return this.#items[index];
  }

  /**
   * Add a sample, which has n and t; one of the newest sample's step replaces it.
   * @returns false for a sample that is too old or too close
   */
  push(sample: Sample): boolean {
    const { newest } = this;
    if (newest !== undefined && sample.n !== newest.n
        && sample.t < newest.t + this.#spacing_s - 1e-9) {
      return false;
    }
    if (sample.n === newest?.n) {
      this.#items.pop();
    }
    this.#items.push(sample);
    if (this.#items.length > this.#capacity) {
      this.#items.shift();
    }
    return true;
  }

  /** Remove all samples. */
  clear() {
    this.#items = [];
  }

  /** Return the index of the last sample at or before a time [s], -1 when all are later. */
  indexAt(t: number): number {
    return countWhile(this.#items.length, (index) => this.#items[index].t <= t) - 1;
  }

  /** Return all samples, oldest first, in a new array. */
  toArray() {
    return [...this.#items];
  }
}
