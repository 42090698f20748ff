// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A bounded ring of received samples in the order of their simulation time. */

import { countWhile } from './search.js';

/** Samples {n, t, …}, oldest first; a new one beyond the capacity replaces the oldest. */
export class SampleRing<Sample extends { n: number; t: number }> {
  #items: (Sample | undefined)[];
  #start = 0;
  #length = 0;
  #spacing_s;

  /**
   * @param capacity how many samples are kept
   * @param spacing_s samples that follow within this time are left out [s]
   */
  constructor(capacity: number, spacing_s = 0) {
    this.#items = new Array(capacity);
    this.#spacing_s = spacing_s;
  }

  /** Return how many samples there are. */
  get length() {
    return this.#length;
  }

  /** Return the newest sample, undefined if there is none. */
  get newest() {
    return this.at(this.#length - 1);
  }

  /** Return a sample; 0 is the oldest. */
  at(index: number): Sample | undefined {
    return index < 0 || index >= this.#length ? undefined
      : this.#items[(this.#start + index) % this.#items.length];
  }

  /**
   * Add a sample; one of the newest sample's step replaces it.
   * @param sample with n and t
   * @returns false for a sample that is too old or too close
   */
  push(sample: Sample): boolean {
    const newest = this.newest;
    if (newest !== undefined) {
      if (sample.n === newest.n) {
        this.#items[(this.#start + this.#length - 1) % this.#items.length] = sample;
        return true;
      }
      if (sample.t < newest.t + this.#spacing_s - 1e-9) {
        return false;
      }
    }
    if (this.#length < this.#items.length) {
      this.#length += 1;
    } else {
      this.#start = (this.#start + 1) % this.#items.length;
    }
    this.#items[(this.#start + this.#length - 1) % this.#items.length] = sample;
    return true;
  }

  /** Remove all samples. */
  clear() {
    this.#items.fill(undefined);
    this.#start = 0;
    this.#length = 0;
  }

  /**
   * Find the last sample at or before a time.
   * @param t simulation time [s]
   * @returns its index, -1 when all are later
   */
  indexAt(t: number): number {
    return countWhile(this.#length, (index) => this.#kept(index).t <= t) - 1;
  }

  /** Return all samples, oldest first, in a new array. */
  toArray() {
    return Array.from({ length: this.#length }, (_, index) => this.#kept(index));
  }

  /** @param index of a sample that is there */
  #kept(index: number): Sample {
    return this.at(index) as Sample;
  }
}
