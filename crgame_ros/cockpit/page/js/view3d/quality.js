// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** How fine and how often pictures are drawn, so that the simulation keeps its share. */

// What a picture may take [ms], and how often there is one at most [ms]: pictures that the
// processor draws are taken from the simulation on the same machine.
const HARDWARE = { budget_ms: 9, period_ms: 0, start: 1 };
const SOFTWARE = { budget_ms: 12, period_ms: 30, start: 0.5 };
const COARSEST = 0.25;
const FINEST = 2;
const TOO_MUCH = 1.2;
const PLENTY = 0.55;
const EVERY_MS = 800;
const STEP_UP = 1.12;
const MOST_DOWN = 0.7;

/** Names of renderers that are the processor itself. */
const SOFTWARE_NAMES = /swiftshader|llvmpipe|softpipe|software|basic render/i;

/**
 * Tell whether a renderer is no graphics card.
 *
 * @param {string} name as WEBGL_debug_renderer_info gives it
 * @returns {boolean}
 */
export function isSoftware(name) {
  return SOFTWARE_NAMES.test(name);
}

/** Chooses the ratio of a picture's pixels to CSS pixels. */
export class Quality {
  #limits;
  #finest;
  #changed_ms = -Infinity;
  #chosen;
  /** Whether nothing is saved, whatever a picture takes. */
  sharp = false;

  /**
   * @param {boolean} software whether the processor draws
   * @param {number} deviceRatio pixels of the screen to a CSS pixel
   */
  constructor(software, deviceRatio) {
    this.#limits = software ? SOFTWARE : HARDWARE;
    this.#finest = Math.min(deviceRatio, FINEST);
    this.#chosen = this.#limits.start * this.#finest;
  }

  /** Pixels to a CSS pixel. */
  get ratio() {
    return this.sharp ? this.#finest : this.#chosen;
  }

  /** Least time from picture to picture [ms]. */
  get period_ms() {
    return this.#limits.period_ms;
  }

  /**
   * Take note of what a picture took.
   *
   * @param {number} cost_ms until it was done
   * @param {number} now_ms
   * @returns {boolean} whether the ratio is another one now
   */
  take(cost_ms, now_ms) {
    const { budget_ms } = this.#limits;
    const share = cost_ms / budget_ms;
    if (this.sharp || now_ms - this.#changed_ms < EVERY_MS
        || (share < TOO_MUCH && share > PLENTY)) {
      return false;
    }
    // What a picture takes grows with its pixels, the square of the ratio.
    const factor = share > 1 ? Math.max(1 / Math.sqrt(share), MOST_DOWN) : STEP_UP;
    const ratio = Math.min(Math.max(this.#chosen * factor, COARSEST), this.#finest);
    if (ratio === this.#chosen) {
      return false;
    }
    this.#chosen = ratio;
    this.#changed_ms = now_ms;
    return true;
  }
}
