// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The player of a recording: the shown time, its motion, and the run that it belongs to. */

import { inEveryFrame } from '../dom.js';
import { errorText } from '../panels/format.js';
import { ask } from './chunks.js';
import { ReplayDocuments } from './documents.js';
import { ReplayFeed } from './replay_feed.js';
import { Timeline } from './timeline.js';

import type { ReplayInfo, ReplayMark } from '../api_messages.js';
import type { RunState } from '../messages.js';
import type { Store } from '../store.js';
import type { Now } from './documents.js';

const SLOWEST = 0.1;
const FASTEST = 8;
// A frame later than this was a stall, over which the time does not move on [s].
const LONGEST_FRAME_S = 0.25;
const TINY_S = 1e-6;
const SETTLED_MS = 300;

/** The player; it does nothing until the server says that this is a replay. */
export class Player {
  #store;
  #timeline;
  #feed: ReplayFeed | null = null;
  #documents: ReplayDocuments | null = null;
  #t = 0;
  // The time that the world shows: the last one with data.
  #shown_t = 0;
  #speed = 1;
  #playing = false;
  #jumped = false;
  #jumped_ms = NaN;
  #frame_ms = NaN;
  #waiting: (() => void)[] = [];
  #opening = false;
  #told = '';

  constructor(root: HTMLElement, store: Store) {
    this.#store = store;
    this.#timeline = new Timeline(root, this);
    const open = () => {
      if (store.mode === 'replay' && this.#feed === null && !this.#opening) {
        this.open();
      }
    };
    store.on(['hello', 'connection'], open);
    // After a lost connection the server sends the scene of the run that it shows first.
    store.on('scene', (scene) => {
      if (this.info !== null && scene.time.epoch !== this.info.epoch) {
        store.receive({ type: 'scene', ...this.info.scene });
      }
    });
    inEveryFrame((now_ms) => this.#advance(now_ms));
    open();
  }

  /** Return the description of the run, null before it has arrived. */
  get info() {
    return this.#feed?.info ?? null;
  }

  /** Return the shown time, or the requested time while its data is loading [s]. */
  get t() {
    return this.#t;
  }

  /** Return the shown simulation step: the last at or before the time. */
  get n() {
    return Math.floor(this.#t / this.#run.dt_s + TINY_S);
  }

  /** Return the shown scenario step. */
  get k() {
    return this.#run.k0 + Math.floor(this.n / this.#run.steps_per_tick);
  }

  /** Return whether the time moves. */
  get playing() {
    return this.#playing;
  }

  /** Return whether the data to show is still loading. */
  get loading() {
    return this.#jumped;
  }

  /** Return the simulated seconds per second. */
  get speed() {
    return this.#speed;
  }

  set speed(value) {
    this.#speed = Math.min(Math.max(value, SLOWEST), FASTEST);
  }

  /** Return how many chunks are in memory. */
  get chunksHeld() {
    return this.#feed?.chunksHeld ?? 0;
  }

  /** Show a run from its beginning; without `epoch`, the one that the server chooses. */
  async open(epoch?: number): Promise<void> {
    this.#opening = true;
    try {
      const answer = await ask('info', epoch === undefined ? {} : { epoch });
      this.#show(await answer.json());
    } catch (error) {
      this.#refuse(error);
    } finally {
      this.#opening = false;
    }
  }

  /** Start playing, from the beginning if the time is at the end. */
  play() {
    if (this.info !== null) {
      if (this.#t >= this.info.end_s - TINY_S) {
        this.seek(this.info.start_s);
      }
      this.#playing = true;
    }
  }

  pause() {
    this.#playing = false;
  }

  toggle() {
    if (this.#playing) {
      this.pause();
    } else {
      this.play();
    }
  }

  /** Go to a time [s] within the recording; return when it is shown. */
  seek(t: number): Promise<void> {
    if (this.info === null) {
      return Promise.resolve();
    }
    this.#t = Math.min(Math.max(t, this.info.start_s), this.info.end_s);
    this.#jumped = true;
    return new Promise((resolve) => {
      this.#waiting.push(resolve);
      this.#update(performance.now());
    });
  }

  /**
   * Go to exactly the next or another scenario step, and pause.
   * @param count how many steps on, negative for back
   * @returns when it is shown
   */
  step(count: number): Promise<void> {
    this.pause();
    if (this.info === null) {
      return Promise.resolve();
    }
    const { dt_s, steps_per_tick, first_n, last_n } = this.info;
    const tick = this.#t / dt_s / steps_per_tick;
    const near = count > 0 ? Math.floor(tick + TINY_S) : Math.ceil(tick - TINY_S);
    const first = Math.ceil(first_n / steps_per_tick);
    const last = Math.floor(last_n / steps_per_tick);
    const wanted = Math.min(Math.max(near + count, first), last);
    return this.seek(wanted * steps_per_tick * dt_s);
  }

  /** Go to the next or the previous event; return the event; `direction`: 1 or -1. */
  jump(direction: number): ReplayMark | null {
    const events = this.info?.events ?? [];
    const found = direction > 0 ? events.find(({ t }) => t > this.#t + TINY_S)
      : events.findLast(({ t }) => t < this.#t - TINY_S);
    if (found !== undefined) {
      this.seek(found.t);
      this.#timeline.showEvent(found);
    }
    return found ?? null;
  }

  /** Return the run; only used while one is shown. */
  get #run() {
    return this.info as ReplayInfo;
  }

  #show(info: ReplayInfo) {
    const store = this.#store;
    this.pause();
    store.restart(info.epoch);
    const feed = new ReplayFeed(store, info, {
      loaded: () => this.#update(performance.now()), refused: (error) => this.#refuse(error),
    });
    this.#feed = feed;
    this.#documents = new ReplayDocuments(store, info);
    store.useTimeSource(() => this.#shown_t);
    store.useHistorySource((index, seconds) => feed.history(index, seconds));
    store.receive({ type: 'scene', ...info.scene });
    this.#timeline.show(info);
    for (const text of info.notices) {
      store.receive({ type: 'notice', level: 'warn', text });
    }
    this.seek(info.start_s);
  }

  #advance(now_ms: number) {
    const passed_s = Math.min((now_ms - this.#frame_ms) / 1000 || 0, LONGEST_FRAME_S);
    this.#frame_ms = now_ms;
    if (this.#feed === null) {
      return;
    }
    if (this.#playing && !this.#jumped) {
      const before = this.#t;
      this.#t = Math.min(this.#t + passed_s * this.#speed, this.#run.end_s);
      if (!this.#update(now_ms)) {
        // The next data has not arrived yet: the time waits for it.
        this.#t = before;
      }
      this.#playing = this.#t < this.#run.end_s;
    } else {
      this.#update(now_ms);
    }
    if (now_ms - this.#jumped_ms > SETTLED_MS) {
      this.#jumped_ms = NaN;
      this.#documents?.replayStatus(this.#now());
    }
  }

  /** Update everything to the time, and return whether its data was there. */
  #update(now_ms: number) {
    const shown = this.#feed?.show(this.#t) ?? NaN;
    const there = !Number.isNaN(shown);
    if (there) {
      this.#t = this.#shown_t = shown;
      this.#documents?.show(this.#now(), now_ms, this.#jumped);
      if (this.#jumped) {
        this.#jumped = false;
        this.#jumped_ms = now_ms;
      }
      this.#waiting.splice(0).forEach((resolve) => resolve());
    }
    this.#timeline.update();
    return there;
  }

  #now(): Now {
    const ended = this.#t >= this.#run.end_s - TINY_S;
    const run: RunState = this.#playing ? 'running' : ended ? 'ended' : 'paused';
    return { t: this.#t, n: this.n, k: this.k, run, speed: this.#speed };
  }

  /** Show an error once. */
  #refuse(error: unknown) {
    const text = errorText(error);
    if (this.#told !== text) {
      this.#told = text;
      this.#store.receive({ type: 'notice', level: 'error', text });
    }
  }
}
