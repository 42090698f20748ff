// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The documents of a recorded run at the time that is shown: signals, events, alarms, status. */

import { countWhile } from '../search.js';

/** @import { RunState, SeatsMessage, Status } from '../messages.js' */
/** @import { ReplayInfo, ReplayTracks } from '../replay_messages.js' */
/** @import { StoreMessage } from '../messages.js' */
/** @import { Store } from '../store.js' */

const STATUS_MS = 200;
const KINDS = /** @type {const} */ (['signals', 'events', 'seats', 'alarms']);
/** @type {{[Kind in typeof KINDS[number]]: Omit<StoreMessage & {type: Kind}, 'type'>}} */
const EMPTY = {
  signals: { k: 0, states: {}, objects: {} }, events: { fired: [] }, seats: { seats: {} },
  alarms: { active: [] },
};
const STATUS_PARTS = /** @type {const} */ (
  ['timing', 'planners', 'drivability', 'seats_lost', 'frames_skipped']);
/** @type {StatusParts} */
const NO_STATUS = {
  timing: null, planners: {}, drivability: {}, seats_lost: {}, frames_skipped: false,
};
// How far before a jump the status is sent again, for its plots [s].
const PAST_STATUS_S = 120;
const PAST_SPACING_S = 0.9;

/**
 * @typedef {Pick<Status, typeof STATUS_PARTS[number]>} StatusParts
 * @typedef {{t: number, n: number, k: number, run: RunState, speed: number}} Now the time that is
 *   shown, and how it moves
 */

/** The setter of the store's documents as the time moves, forward and back. */
export class ReplayDocuments {
  #store;
  #info;
  /** @type {Partial<Record<typeof KINDS[number], number>>} */
  #shown = {};
  #run = '';
  #told_ms = -Infinity;

  /**
   * @param {Store} store
   * @param {ReplayInfo} info of the run
   */
  constructor(store, info) {
    this.#store = store;
    this.#info = info;
  }

  /**
   * Set the documents that are valid at a time.
   *
   * @param {Now} now
   * @param {number} now_ms wall time
   * @param {boolean} jumped whether the time has jumped
   */
  show(now, now_ms, jumped) {
    for (const kind of KINDS) {
      const place = this.#place(kind, now.t);
      if (this.#shown[kind] !== place) {
        this.#shown[kind] = place;
        const content = this.#info.documents[kind]?.[place]?.[1] ?? EMPTY[kind];
        this.#store.receive(/** @type {StoreMessage} */ (
          { type: kind, ...('seats' in content ? withoutHolders(content) : content) }));
      }
    }
    if (jumped || now.run !== this.#run || now_ms - this.#told_ms >= STATUS_MS) {
      this.#run = now.run;
      this.#told_ms = now_ms;
      this.#store.receive({ type: 'status', ...this.#status(now) });
    }
  }

  /**
   * Send the past status again after a jump.
   *
   * @param {Now} now
   */
  replayStatus(now) {
    const { planners, timing } = this.#info.documents;
    /** @type {number[]} */
    const times = [];
    for (const [t] of planners ?? timing ?? []) {
      const since = t - (times.at(-1) ?? -Infinity);
      if (t > now.t - PAST_STATUS_S && t < now.t && since >= PAST_SPACING_S) {
        times.push(t);
      }
    }
    const { dt_s, steps_per_tick, k0 } = this.#info;
    for (const t of times) {
      const n = Math.round(t / dt_s);
      const k = k0 + Math.floor(n / steps_per_tick);
      this.#store.receive({ type: 'status', ...this.#status({ ...now, t, n, k }) });
    }
    this.#store.receive({ type: 'status', ...this.#status(now) });
  }

  /**
   * @param {Now} now
   * @returns {Status}
   */
  #status({ t, n, k, run, speed }) {
    const parts = STATUS_PARTS.map((part) => {
      const held = this.#info.documents[part]?.[this.#place(part, t)];
      return [part, held === undefined ? NO_STATUS[part] : held[1]];
    });
    return {
      run, t, n, k, epoch: this.#info.epoch, real_time_factor: speed,
      measured_factor: run === 'running' ? speed : null, clients: 1,
      recording: { state: 'none', messages: 0, megabytes: 0, text: 'A recording is shown' },
      .../** @type {StatusParts} */ (Object.fromEntries(parts)),
    };
  }

  /**
   * Find the entry of a document that holds at a time; -1 before the first.
   *
   * @param {keyof ReplayTracks} kind
   * @param {number} t
   */
  #place(kind, t) {
    const track = this.#info.documents[kind] ?? [];
    return countWhile(track.length, (index) => track[index][0] <= t + 1e-9) - 1;
  }
}

/**
 * Return the seats without holders: no client of this page held one in the recorded run.
 *
 * @param {Omit<SeatsMessage, 'type'>} document
 */
function withoutHolders({ seats }) {
  return { seats: Object.fromEntries(Object.entries(seats).map(([id, seat]) => [
    id, { ...seat, holder: null, holder_name: '', requests: [], lost: false }])) };
}
