// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The documents of a recorded run at the time that is shown: signals, events, alarms, status. */

const STATUS_MS = 200;
const EMPTY = {
  signals: { k: 0, states: {} }, events: { fired: [] }, seats: { seats: {} },
  alarms: { active: [] },
};
const STATUS_PARTS = ['timing', 'planners', 'drivability', 'seats_lost', 'frames_skipped'];
const NO_STATUS = {
  timing: null, planners: {}, drivability: {}, seats_lost: {}, frames_skipped: false,
};
// The status of so long before a jump is told again, for the plots of it [s].
const PAST_STATUS_S = 120;
const PAST_SPACING_S = 0.9;

/** Sets the store's documents as the time moves, forward and back. */
export class ReplayDocuments {
  #store;
  #info;
  #shown = {};
  #run = '';
  #told_ms = -Infinity;

  /**
   * @param {import('../store.js').Store} store
   * @param {object} info of the run
   */
  constructor(store, info) {
    this.#store = store;
    this.#info = info;
  }

  /**
   * Set what holds at a time.
   *
   * @param {object} now t [s], n, k, run ('running', 'paused', 'ended'), speed
   * @param {number} now_ms wall time
   * @param {boolean} jumped whether the time did not just go on
   */
  show(now, now_ms, jumped) {
    for (const [kind, empty] of Object.entries(EMPTY)) {
      const place = this.#place(kind, now.t);
      if (this.#shown[kind] !== place) {
        this.#shown[kind] = place;
        const content = place < 0 ? empty : this.#info.documents[kind][place][1];
        this.#store.receive({ type: kind, ...(kind === 'seats' ? withoutHolders(content)
          : content) });
      }
    }
    if (jumped || now.run !== this.#run || now_ms - this.#told_ms >= STATUS_MS) {
      this.#run = now.run;
      this.#told_ms = now_ms;
      this.#store.receive({ type: 'status', ...this.#status(now) });
    }
  }

  /**
   * Tell the past status once more, after a jump to a time.
   *
   * @param {object} now as in `show`
   */
  tellPast(now) {
    const { planners, timing } = this.#info.documents;
    const times = [];
    for (const [t] of planners ?? timing ?? []) {
      if (t > now.t - PAST_STATUS_S && t < now.t && !(t < times.at(-1) + PAST_SPACING_S)) {
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

  #status({ t, n, k, run, speed }) {
    const parts = STATUS_PARTS.map((part) => {
      const place = this.#place(part, t);
      return [part, place < 0 ? NO_STATUS[part] : this.#info.documents[part][place][1]];
    });
    return {
      run, t, n, k, epoch: this.#info.epoch, real_time_factor: speed,
      measured_factor: run === 'running' ? speed : null, clients: 1,
      recording: { state: 'none', messages: 0, megabytes: 0, text: 'A recording is shown' },
      ...Object.fromEntries(parts),
    };
  }

  /** Find the entry of a document that holds at a time; -1 before the first. */
  #place(kind, t) {
    const track = this.#info.documents[kind] ?? [];
    let low = 0;
    let high = track.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (track[middle][0] <= t + 1e-9) {
        low = middle + 1;
      } else {
        high = middle;
      }
    }
    return low - 1;
  }
}

/** Nobody on this page held a seat of a recorded run. */
function withoutHolders({ seats }) {
  return { seats: Object.fromEntries(Object.entries(seats).map(([id, seat]) => [
    id, { ...seat, holder: null, holder_name: '', requests: [], lost: false }])) };
}
