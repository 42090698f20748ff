// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The documents of a recorded run at the time that is shown: signals, events, alarms, status. */

import { countWhile } from '../search.js';

import type { ReplayInfo, ReplayTracks } from '../api_messages.js';
import type { RunState, Status, StoreMessage } from '../messages.js';
import type { Store } from '../store.js';

const STATUS_MS = 200;
const KINDS = ['signals', 'events', 'seats', 'alarms'] as const;
const EMPTY: { [Kind in typeof KINDS[number]]: Omit<StoreMessage & { type: Kind }, 'type'> } = {
  signals: { k: 0, states: {}, objects: {} }, events: { fired: [] }, seats: { seats: {} },
  alarms: { active: [] },
};
const STATUS_PARTS = [
  'timing', 'planners', 'drivability', 'seats_lost', 'frames_skipped'] as const;
const NO_STATUS: StatusParts = {
  timing: null, planners: {}, drivability: {}, seats_lost: {}, frames_skipped: false,
};
// How far before a jump the status is sent again, for its plots [s].
const PAST_STATUS_S = 120;
const PAST_SPACING_S = 0.9;

export type StatusParts = Pick<Status, typeof STATUS_PARTS[number]>;
/** The time that is shown, and how it moves. */
export interface Now { t: number; n: number; k: number; run: RunState; speed: number }

/** The setter of the store's documents as the time moves, forward and back. */
export class ReplayDocuments {
  #store;
  #info;
  #shown: Partial<Record<typeof KINDS[number], number>> = {};
  #run = '';
  #told_ms = -Infinity;

  /** @param info of the run */
  constructor(store: Store, info: ReplayInfo) {
    this.#store = store;
    this.#info = info;
  }

  /**
   * Set the documents that are valid at a time.
   * @param now_ms wall time
   * @param jumped whether the time has jumped
   */
  show(now: Now, now_ms: number, jumped: boolean) {
    for (const kind of KINDS) {
      const place = this.#place(kind, now.t);
      if (this.#shown[kind] !== place) {
        this.#shown[kind] = place;
        const content = this.#info.documents[kind]?.[place]?.[1] ?? EMPTY[kind];
        this.#store.receive({ type: kind, ...content } as StoreMessage);
      }
    }
    if (jumped || now.run !== this.#run || now_ms - this.#told_ms >= STATUS_MS) {
      this.#run = now.run;
      this.#told_ms = now_ms;
      this.#store.receive({ type: 'status', ...this.#status(now) });
    }
  }

  /** Send the past status again after a jump. */
  replayStatus(now: Now) {
    const { planners, timing } = this.#info.documents;
    const times: number[] = [];
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

  #status({ t, n, k, run, speed }: Now): Status {
    const parts = STATUS_PARTS.map((part) => {
      const held = this.#info.documents[part]?.[this.#place(part, t)];
      return [part, held === undefined ? NO_STATUS[part] : held[1]];
    });
    return {
      run, t, n, k, epoch: this.#info.epoch, real_time_factor: speed,
      measured_factor: run === 'running' ? speed : null, clients: 1,
      recording: { state: 'none', messages: 0, megabytes: 0, text: 'A recording is shown' },
      ...Object.fromEntries(parts) as StatusParts,
    };
  }

  /** Find the entry of a document that holds at a time; -1 before the first. */
  #place(kind: keyof ReplayTracks, t: number) {
    const track = this.#info.documents[kind] ?? [];
    return countWhile(track.length, (index) => track[index][0] <= t + 1e-9) - 1;
  }
}
