// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The feed of the store with a recorded run, as the connection feeds a live one. */

import { CriticalityLog } from '../criticality.js';
import { decodeFrame, KIND } from '../frames.js';
import { addToHistory, emptyHistory } from '../history.js';
import { countWhile } from '../search.js';
import { ask, Chunks, unpack } from './chunks.js';

import type { ReplayInfo } from '../api_messages.js';
import type { StateFrame } from '../frames.js';
import type { History } from '../history.js';
import type { Store } from '../store.js';
import type { Entry } from './chunks.js';

const AHEAD = 2;
// After a jump, the store gets the states of this time before it [s].
const BEFORE_S = 0.5;
// A longer step forward is a jump [s].
const LONGEST_WAY_S = 1;
const SAME_TIME_S = 1e-9;
// How much of the future is in the plots [s]: their window reaches beyond the shown time.
const FUTURE_S = 60;

/** One run of a recording, from which the store gets the data of the shown time. */
export class ReplayFeed {
  #store;
  #chunks;
  // The chunk and the position in it of the next entry.
  #next = { number: 0, place: 0 };
  #early: Entry | null = null;
  #shown = NaN;
  #outline: StateFrame[] = [];

  /** The server's description of the run. */
  info;

  /**
   * @param info of the run
   * @param told `loaded` after new data has come, `refused` if it cannot be loaded
   */
  constructor(store: Store, info: ReplayInfo,
    { loaded, refused }: { loaded: () => void; refused: (error: Error) => void }) {
    this.#store = store;
    this.info = info;
    this.#chunks = new Chunks(info, loaded, refused);
    ask('outline', { epoch: info.epoch }).then(async (answer) => {
      this.#outline = unpack(await answer.arrayBuffer()).map(decodeFrame)
        .filter((frame) => frame?.kind === KIND.STATE);
    }).catch(refused);
    const log = new CriticalityLog(() => store.measures, Infinity,
      () => this.#askCriticality(log, refused));
    store.criticality = log;
  }

  /** Return how many chunks are in memory. */
  get chunksHeld() {
    return this.#chunks.size;
  }

  /**
   * Request the criticality of the whole run; it takes a while if it was not recorded.
   * @param log gets it
   */
  async #askCriticality(log: CriticalityLog, refused: (error: Error) => void) {
    try {
      const answer = await ask('criticality', { epoch: this.info.epoch });
      for (const frame of unpack(await answer.arrayBuffer()).map(decodeFrame)) {
        if (frame?.kind === KIND.CRITICALITY) {
          log.add(frame);
        }
      }
    } catch (error) {
      refused(error as Error);
    }
  }

  /**
   * Feed the store with the data of a time.
   * @param t simulation time [s]
   * @returns the shown time: that of a state close to t, else t; NaN while its data is loading
   */
  show(t: number): number {
    const number = this.#chunks.numberAt(t);
    this.#chunks.want(number, AHEAD);
    const entries = this.#chunks.get(number);
    if (entries === undefined) {
      return NaN;
    }
    if (!(t >= this.#shown - SAME_TIME_S && t - this.#shown < LONGEST_WAY_S)
        || this.#store.epoch !== this.info.epoch) {
      this.#jump(entries, number, t);
    }
    this.#proceed(t);
    const state = this.#store.samples.at(this.#store.samples.indexAt(t + SAME_TIME_S));
    this.#shown = state !== undefined && Math.abs(state.t - t) <= SAME_TIME_S ? state.t : t;
    return this.#shown;
  }

  /**
   * Return a vehicle's motion around the shown time, as `Store.history` does.
   * @param index of the vehicle
   * @param seconds how far back
   */
  history(index: number, seconds: number): History {
    const past = emptyHistory();
    const [first, end] = [this.#shown - seconds, this.#shown + FUTURE_S];
    const from = countWhile(this.#outline.length, (i) => this.#outline[i].t < first);
    for (const sample of this.#outline.slice(from)) {
      if (sample.t > end) {
        break;
      }
      addToHistory(past, sample, index);
    }
    return past;
  }

  /** Restart shortly before a time, with the frames of each kind that are still valid then. */
  #jump(entries: Entry[], number: number, t: number) {
    this.#store.restart(this.info.epoch);
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

  /** Advance to a time and one state beyond it, between which the page interpolates. */
  #proceed(t: number) {
    for (;;) {
      const next = this.#next;
      const entries = this.#chunks.get(next.number);
      if (entries === undefined) {
        return;
      }
      while (next.place < entries.length && entries[next.place].at <= t + SAME_TIME_S) {
        this.#give(entries[next.place]);
        next.place += 1;
      }
      const following = entries.slice(next.place).find(({ kind }) => kind === KIND.STATE);
      if (following !== undefined || next.number + 1 >= this.info.chunks) {
        if (following !== undefined && following !== this.#early) {
          this.#give(following);
          this.#early = following;
        }
        return;
      }
      this.#next = { number: next.number + 1, place: 0 };
    }
  }

  #give(entry: Entry) {
    if (entry !== this.#early) {
      this.#store.receiveFrame(entry.buffer, performance.now());
    }
  }
}
