// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Instant replay of the last seconds, optionally slowed, from the states that this page keeps. */

import { element, setAttribute, setText } from '../dom.js';
import { clockTime } from '../panels/format.js';
import { icon } from '../panels/icons.js';

import type { Store } from '../store.js';

const REPLAYED_S = 10;
const SPEEDS = [1, 0.5, 0.25, 0.1];
const DRAWN_EVERY_MS = 100;

/** The bar over the map and the time shown while it is open; one per page. */
export class InstantReplay {
  #root;
  #store;
  #playing = false;
  #t = 0;
  #first = 0;
  #last = 0;
  #speed = 1;
  #at_ms = NaN;
  #timer = 0;
  #time = element('output', { class: 'last-time' });
  #play;
  #slider;

  /** `root` of the bar; `store`: its samples are shown. */
  constructor(root: HTMLElement, store: Store) {
    this.#root = root;
    this.#store = store;
    this.#play = element('button', { type: 'button', class: 'icon-button', 'data-action': 'play',
      on: { click: () => this.#toggle() } });
    this.#slider = element('input', { type: 'range', step: 0.01, 'aria-label': 'Time of the run',
      on: { input: () => this.#seek(Number(this.#slider.value)) } });
    const speed = element('select', { 'aria-label': 'Speed of the replay',
      on: { change: () => this.#setSpeed(Number(speed.value)) } }, ...SPEEDS.map(
      (factor) => element('option', { value: factor, text: `× ${factor}` })));
    root.replaceChildren(element('strong', { text: 'Once more' }), this.#play, this.#slider,
      this.#time, speed, element('button', { type: 'button', class: 'icon-button',
        'data-action': 'end', title: 'Back (Escape)', 'aria-label': 'Back',
        on: { click: () => this.close() } }, icon('close')));
    store.on('epoch', () => this.close());
    store.on('status', ({ run }) => run === 'running' && this.close());
    window.addEventListener('keydown', (event) => {
      if (event.key === 'Escape' && this.isOpen) {
        this.close();
      }
    });
  }

  /** Return whether it shows the past now. */
  get isOpen() {
    return !this.#root.hidden;
  }

  /** Return whether there is a past to show and no running present that it would hide. */
  get isPossible() {
    return this.#store.samples.length > 1 && this.#store.status?.run !== 'running';
  }

  /** Return the time that is shown [s]. */
  get t() {
    return this.#t;
  }

  /** Show the last seconds from their beginning. */
  open() {
    const { samples } = this.#store;
    if (!this.isPossible || samples.newest === undefined) {
      return;
    }
    this.#last = samples.newest.t;
    this.#first = Math.max(samples.at(0)?.t ?? this.#last, this.#last - REPLAYED_S);
    Object.assign(this.#slider, { min: String(this.#first), max: String(this.#last) });
    this.#setOpen(true);
    this.#t = this.#first;
    this.#setPlaying(true);
    this.#store.useTimeSource((now_ms) => this.#timeAt(now_ms));
    this.#timer = setInterval(() => this.#show(), DRAWN_EVERY_MS);
  }

  /** Go back to the present. */
  close() {
    if (this.isOpen) {
      this.#setOpen(false);
      clearInterval(this.#timer);
      this.#store.useTimeSource(null);
    }
  }

  #setOpen(open: boolean) {
    setAttribute(this.#root, 'hidden', !open);
    // Parts that describe the present are hidden.
    setAttribute(document.body, 'data-past', open);
  }

  #timeAt(now_ms: number) {
    if (this.#playing && Number.isFinite(this.#at_ms)) {
      const t = this.#t + this.#speed * Math.max(now_ms - this.#at_ms, 0) / 1000;
      this.#t = Math.min(t, this.#last);
    }
    this.#at_ms = now_ms;
    return this.#t;
  }

  #show() {
    if (this.#playing && this.#t >= this.#last) {
      this.#setPlaying(false);
    }
    this.#slider.value = String(this.#t);
    setText(this.#time, clockTime(this.#t));
  }

  #toggle() {
    if (!this.#playing && this.#t >= this.#last) {
      this.#t = this.#first;
    }
    this.#setPlaying(!this.#playing);
  }

  #seek(t: number) {
    this.#t = t;
    this.#setPlaying(false);
  }

  #setSpeed(speed: number) {
    this.#speed = speed;
    this.#show();
  }

  #setPlaying(playing: boolean) {
    this.#playing = playing;
    this.#at_ms = NaN;
    this.#play.replaceChildren(icon(playing ? 'pause' : 'go'));
    this.#play.title = playing ? 'Hold' : 'Play';
    setAttribute(this.#play, 'aria-label', this.#play.title);
    this.#show();
  }
}
