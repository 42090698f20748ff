// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The steady clock of the server's machine, estimated from pings, with its uncertainty. */

// Of that many pings the quickest counts: what delays the others delays one way only.
const KEPT = 60;

/** A time on the server's clock, and half of the round trip that related the clocks. */
export interface ServerTime { steady_s: number; clock_error_ms: number }

interface Exchange { offset_ms: number; round_trip_ms: number }

/** The offset between both clocks. */
export class ServerClock {
  #exchanges: Exchange[] = [];

  /**
   * Add a ping with its pong.
   * @param sent_ms by performance.now
   * @param received_ms likewise
   * @param steady_s the server's clock when it answered
   */
  add(sent_ms: number, received_ms: number, steady_s: number) {
    const round_trip_ms = received_ms - sent_ms;
    if (!Number.isFinite(steady_s) || round_trip_ms < 0) {
      return;
    }
    this.#exchanges.push({ offset_ms: 1000 * steady_s - (sent_ms + received_ms) / 2,
      round_trip_ms });
    if (this.#exchanges.length > KEPT) {
      this.#exchanges.shift();
    }
  }

  /** Forget everything: another server may run on another machine. */
  forget() {
    this.#exchanges = [];
  }

  /** Return null before the first exchange; `now_ms` by performance.now. */
  at(now_ms: number): ServerTime | null {
    const best = this.#exchanges.reduce<Exchange | null>((least, each) => (
      least === null || each.round_trip_ms <= least.round_trip_ms ? each : least), null);
    return best === null ? null : { steady_s: (now_ms + best.offset_ms) / 1000,
      clock_error_ms: best.round_trip_ms / 2 };
  }
}
