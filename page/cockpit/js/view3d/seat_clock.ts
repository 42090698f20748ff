// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Synchronisation of the windows of one seat: all show the simulation time of the leading one. */

import type { Store } from '../store.js';

const CHANNEL = 'crgame-seat';
// After this silence, the leader is gone or its window is hidden [ms].
const SILENCE_MS = 400;

/** The message of the leader in each frame. */
export interface Beat {
  t: number; // simulation time that it shows [s]
  at_ms: number; // time of the message, by the machine's clock
  rate: number; // simulated seconds per second; 0 while it stands still
  epoch: number; // counts resets
  vehicle: string | null; // whose view it shows
}

export interface Player {
  info: object | null;
  t: number;
  seek: (t: number) => unknown;
  pause: () => void;
}

/** The sender or receiver of the shown time. */
export class SeatClock {
  #store;
  #channel = new BroadcastChannel(CHANNEL);
  #heard: Beat | null = null;
  #follows;
  #last = { t: NaN, at_ms: NaN };

  /**
   * @param follows whether this window follows another one
   * @param wanted id of the vehicle whose leader is followed; null for any
   */
  constructor(store: Store, follows: boolean, wanted: string | null) {
    this.#store = store;
    this.#follows = follows;
    if (follows) {
      this.#channel.addEventListener('message', ({ data }) => {
        if (wanted === null || data.vehicle === wanted) {
          this.#heard = data;
        }
      });
    }
  }

  /** Return the vehicle that the leader shows; null without a leader. */
  get vehicle() {
    return this.#leads(performance.now()) ? this.#heard?.vehicle ?? null : null;
  }

  /**
   * Send the shown time to the followers.
   * @param now_ms the animation frame's time
   * @param t simulation time that is shown [s]
   */
  send(now_ms: number, t: number, vehicle: string | null) {
    if (this.#follows) {
      return;
    }
    const at_ms = performance.timeOrigin + now_ms;
    const rate = (t - this.#last.t) / (at_ms - this.#last.at_ms) * 1000;
    this.#last = { t, at_ms };
    const beat: Beat = { t, at_ms, rate: Number.isFinite(rate) ? rate : 0,
      epoch: this.#store.epoch, vehicle };
    this.#channel.postMessage(beat);
  }

  /**
   * Show the leader's time before a frame, while there is a leader.
   * @param now_ms the animation frame's time
   */
  follow(now_ms: number) {
    if (!this.#follows) {
      return;
    }
    const player = window.crgame.replay as Player | undefined;
    if (this.#store.mode === 'replay') {
      if (player?.info && this.#leads(now_ms)) {
        player.pause();
        if (Math.abs(player.t - this.#time(now_ms)) > 0) {
          player.seek(this.#time(now_ms));
        }
      }
    } else {
      this.#store.useTimeSource(this.#leads(now_ms) ? (ms) => this.#time(ms) : null);
    }
  }

  #leads(now_ms: number) {
    const beat = this.#heard;
    return beat !== null && beat.epoch === this.#store.epoch
      && performance.timeOrigin + now_ms - beat.at_ms < SILENCE_MS;
  }

  #time(now_ms: number) {
    const { t, at_ms, rate } = this.#heard as Beat;
    const since_ms = Math.max(performance.timeOrigin + now_ms - at_ms, 0);
    return t + rate * since_ms / 1000;
  }
}
