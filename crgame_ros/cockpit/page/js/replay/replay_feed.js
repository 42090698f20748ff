// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Feeds the store with a recorded run, as the connection does with a live one. */

import { decodeFrame, KIND, VEHICLE, VEHICLE_WIDTH } from '../frames.js';
import { ask, Chunks, unpack } from './chunks.js';

const AHEAD = 2;
// After a jump the states of so long before it are given to the store [s].
const BEFORE_S = 0.5;
// A longer way forward is a jump [s].
const LONGEST_WAY_S = 1;
const SAME_TIME_S = 1e-9;
// How much of the future is in the plots [s]: their window reaches beyond the shown time.
const FUTURE_S = 60;

/** One run of a recording; the store gets what is to be seen at the time that is shown. */
export class ReplayFeed {
  #store;
  #chunks;
  #next = null;
  #early = null;
  #shown = NaN;
  #outline = [];

  /** What the server says of the run. */
  info;

  /**
   * @param {import('../store.js').Store} store
   * @param {object} info of the run
   * @param {object} told loaded() after new data has come, refused(error) when it cannot be had
   */
  constructor(store, info, { loaded, refused }) {
    this.#store = store;
    this.info = info;
    this.#chunks = new Chunks(info, loaded, refused);
    ask('outline', { epoch: info.epoch }).then(async (answer) => {
      this.#outline = unpack(await answer.arrayBuffer()).map(decodeFrame);
    }).catch(refused);
  }

  /** How many chunks are in memory. */
  get chunksHeld() {
    return this.#chunks.size;
  }

  /**
   * Give the store what is to be seen at a time.
   *
   * @param {number} t simulation time [s]
   * @returns {number} the time that is shown: that of a state that is as good as there, else t;
   *   NaN while the data for it has not come
   */
  show(t) {
    const number = this.#chunks.numberAt(t);
    this.#chunks.want(number, AHEAD);
    if (this.#chunks.get(number) === undefined) {
      return NaN;
    }
    if (!(t >= this.#shown - SAME_TIME_S && t - this.#shown < LONGEST_WAY_S)
        || this.#store.epoch !== this.info.epoch) {
      this.#jump(number, t);
    }
    this.#proceed(t);
    const state = this.#store.samples.at(this.#store.samples.indexAt(t + SAME_TIME_S));
    this.#shown = state !== undefined && Math.abs(state.t - t) <= SAME_TIME_S ? state.t : t;
    return this.#shown;
  }

  /**
   * Give a vehicle's motion around the shown time, as `Store.history` does.
   *
   * @param {number} index of the vehicle
   * @param {number} seconds how far back
   * @returns {object} t and each column of VEHICLE, arrays of the same length
   */
  history(index, seconds) {
    const past = { t: [] };
    for (const name of Object.keys(VEHICLE)) {
      past[name] = [];
    }
    const columns = Object.entries(VEHICLE);
    const end = this.#shown + FUTURE_S;
    for (let i = this.#outlineFrom(this.#shown - seconds); i < this.#outline.length; i += 1) {
      const { t, vehicles } = this.#outline[i];
      if (t > end) {
        break;
      }
      past.t.push(t);
      for (const [name, column] of columns) {
        past[name].push(vehicles[index * VEHICLE_WIDTH + column]);
      }
    }
    return past;
  }

  /** Find the first sample for plots that is not before a time. */
  #outlineFrom(t) {
    let low = 0;
    let high = this.#outline.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.#outline[middle].t < t) {
        low = middle + 1;
      } else {
        high = middle;
      }
    }
    return low;
  }

  /** Begin anew shortly before a time: of each kind of frame only what still counts then. */
  #jump(number, t) {
    this.#store.restart(this.info.epoch);
    const entries = this.#chunks.get(number);
    const end = entries.findIndex((entry) => entry.at > t + SAME_TIME_S);
    const past = end < 0 ? entries : entries.slice(0, end);
    const newest = new Map(past.map((entry) => [entry.slot, entry]));
    for (const entry of past) {
      if (newest.get(entry.slot) === entry
          || entry.kind === KIND.STATE && entry.at > t - BEFORE_S) {
        this.#give(entry);
      }
    }
    this.#next = { number, place: past.length };
    this.#early = null;
  }

  /** Go on to a time, and one state beyond it: between the two is interpolated. */
  #proceed(t) {
    for (;;) {
      const entries = this.#chunks.get(this.#next.number);
      if (entries === undefined) {
        return;
      }
      while (this.#next.place < entries.length
             && entries[this.#next.place].at <= t + SAME_TIME_S) {
        this.#give(entries[this.#next.place]);
        this.#next.place += 1;
      }
      const following = entries.slice(this.#next.place).find(({ kind }) => kind === KIND.STATE);
      if (following !== undefined || this.#next.number + 1 >= this.info.chunks) {
        if (following !== undefined && following !== this.#early) {
          this.#give(following);
          this.#early = following;
        }
        return;
      }
      this.#next = { number: this.#next.number + 1, place: 0 };
    }
  }

  #give(entry) {
    if (entry !== this.#early) {
      this.#store.receiveFrame(entry.buffer, performance.now());
    }
  }
}
