// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The browser's audio output: started by a gesture, open while there is sound. */

import { volumeGain } from './levels.js';
import { SoundGraph } from './sound_graph.js';

import type { Heard } from './listener.js';
import type { Trouble } from './sound_graph.js';

// Length of silence after which the audio device is released [ms].
const IDLE_MS = 1000;

/** The player of the sounds. */
export class Speaker {
  #context: AudioContext | null = null;
  #graph: SoundGraph | null = null;
  #gain = NaN;
  #quiet = true;
  // Whether this class, not the browser, has suspended the context.
  #idle = false;
  #idleTimer = 0;
  #changed;

  /** @param changed called when the browser allows or stops playing */
  constructor(changed: () => void) {
    this.#changed = changed;
  }

  /** Return whether the browser has allowed it to start. */
  get begun() {
    return this.#context !== null && (this.#context.state === 'running' || this.#idle);
  }

  /** Start; browsers allow this only in a click or a key press. */
  begin() {
    if (this.#context === null) {
      this.#context = new AudioContext({ latencyHint: 'interactive' });
      this.#context.addEventListener('statechange', () => this.#changed());
      this.#graph = new SoundGraph(this.#context);
    }
    this.#resume();
  }

  /** Play, from now on; `volume`: 0 to 1. */
  play(heard: Heard, trouble: Trouble, volume: number) {
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

  /** Fade to silence within 40 ms. */
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
