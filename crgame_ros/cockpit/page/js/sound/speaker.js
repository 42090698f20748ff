// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The browser's loudspeaker: begun by a gesture, open while something is to be heard. */

import { volumeGain } from './levels.js';
import { SoundGraph } from './sound_graph.js';

/** @import { Heard } from './listener.js' */
/** @import { Trouble } from './sound_graph.js' */

// After so long a silence the audio device is let go [ms].
const IDLE_MS = 1000;

/** Plays what is heard. */
export class Speaker {
  /** @type {AudioContext|null} */
  #context = null;
  /** @type {SoundGraph|null} */
  #graph = null;
  #gain = NaN;
  #quiet = true;
  // Whether the context was suspended here, and not by the browser.
  #idle = false;
  #idleTimer = 0;
  #changed;

  /** @param {() => void} changed called when the browser lets it play, or stops it */
  constructor(changed) {
    this.#changed = changed;
  }

  /** Return whether the browser has let it begin. */
  get begun() {
    return this.#context !== null && (this.#context.state === 'running' || this.#idle);
  }

  /** Begin; browsers allow it in a click or a key alone. */
  begin() {
    if (this.#context === null) {
      this.#context = new AudioContext({ latencyHint: 'interactive' });
      this.#context.addEventListener('statechange', () => this.#changed());
      this.#graph = new SoundGraph(this.#context);
    }
    this.#resume();
  }

  /**
   * Play, from now on.
   *
   * @param {Heard} heard
   * @param {Trouble} trouble
   * @param {number} volume 0 to 1
   */
  play(heard, trouble, volume) {
    if (this.#context === null || this.#graph === null) {
      return;
    }
    this.#quiet = false;
    if (this.#idle) {
      this.#resume();
    }
    const when = this.#context.currentTime;
    this.#graph.update(heard, trouble, when);
    const gain = volumeGain(volume);
    if (gain !== this.#gain) {
      this.#gain = gain;
      this.#graph.open(gain, when);
    }
  }

  /** Be silent: nothing is heard 40 ms later. */
  hush() {
    if (!this.#quiet) {
      this.#quiet = true;
      this.#gain = NaN;
      this.#graph?.hush(this.#context?.currentTime ?? 0);
      this.#rest();
    }
  }

  #rest() {
    clearTimeout(this.#idleTimer);
    this.#idleTimer = setTimeout(() => {
      if (this.#quiet && this.#context?.state === 'running') {
        this.#idle = true;
        this.#context.suspend();
      }
    }, IDLE_MS);
  }

  #resume() {
    this.#idle = false;
    this.#context?.resume().then(() => this.#rest(), () => this.#changed());
  }
}
