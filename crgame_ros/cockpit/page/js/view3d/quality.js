// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * How good pictures are, so that drawing keeps up: by what they are measured to take, on any
 * machine. What draws is known by name only to begin with a good guess.
 */

/**
 * What is left out of a picture.
 *
 * @typedef {object} Detail
 * @property {number} plain_m beyond it vehicles and trees have few triangles
 * @property {number} farthest_m beyond it no vehicle is drawn
 * @property {number} wheels_m beyond it wheels are discs on the flanks
 * @property {boolean} fine whether the sky has a sun and a glow, and surfaces are as sharp in
 *   the distance as can be
 * @property {number} mirrorEvery a mirror is drawn with each picture, or with each second one
 */

/** From all that there is to what is told from each other no more. @type {Detail[]} */
export const DETAILS = [
  { plain_m: Infinity, farthest_m: 600, wheels_m: 600, fine: true, mirrorEvery: 1 },
  { plain_m: 60, farthest_m: 400, wheels_m: 90, fine: false, mirrorEvery: 1 },
  { plain_m: 30, farthest_m: 250, wheels_m: 50, fine: false, mirrorEvery: 2 },
];

/**
 * Pixels of a picture to those that it could have, in each direction, and its detail: from the
 * best to the cheapest.
 *
 * @type {[share: number, detail: number][]}
 */
const RUNGS = [[1, 0], [0.85, 0], [0.7, 0], [0.7, 1], [0.6, 1], [0.5, 1], [0.42, 1], [0.42, 2],
  [0.35, 2], [0.3, 2], [0.25, 2]];
// What a picture may take until it is done [ms].
const BUDGET_MS = 9;
// The rung to begin with. Pictures that the processor draws are taken from the simulation on the
// same machine: they come no more often than that [ms].
const HARDWARE = { period_ms: 0, start: 0 };
const SOFTWARE = { period_ms: 33, start: 5 };
const FINEST = 2;
const TOO_MUCH = 1.2;
const PLENTY = 0.8;
const EVERY_MS = 800;
// A rung that was too dear is tried again after so long, then after twice as long, and so on.
const AGAIN_MS = 20_000;
// Of the time, no more goes to pictures.
const MOST_SHARE = 0.3;
const SLOWEST_MS = 50;

/** Names of renderers that are the processor itself. */
const SOFTWARE_NAMES = /swiftshader|llvmpipe|softpipe|software|basic render/i;

/**
 * Return whether a renderer is no graphics card.
 *
 * @param {string} name as WEBGL_debug_renderer_info gives it
 * @returns {boolean}
 */
export function isSoftware(name) {
  return SOFTWARE_NAMES.test(name);
}

/** Chooses the ratio of a picture's pixels to CSS pixels, and what is left out. */
export class Quality {
  #limits;
  #finest;
  #changed_ms = -Infinity;
  #rung;
  #cost_ms = 0;
  /** By rung: not before that time again, and how long it was refused. */
  #refused = RUNGS.map(() => ({ until_ms: -Infinity, for_ms: AGAIN_MS }));
  /** Whether nothing is saved, whatever a picture takes. */
  sharp = false;

  /**
   * @param {boolean} software whether the processor draws
   * @param {number} deviceRatio pixels of the screen to a CSS pixel
   */
  constructor(software, deviceRatio) {
    this.#limits = software ? SOFTWARE : HARDWARE;
    this.#finest = Math.min(deviceRatio, FINEST);
    this.#rung = this.#limits.start;
  }

  /** Pixels to a CSS pixel. */
  get ratio() {
    return this.sharp ? this.#finest : RUNGS[this.#rung][0] * this.#finest;
  }

  /** What pictures leave out. */
  get detail() {
    return DETAILS[this.sharp ? 0 : RUNGS[this.#rung][1]];
  }

  /** Least time from picture to picture [ms]. */
  get period_ms() {
    // Whoever has come down that far is taken for a processor, whatever its name.
    const { period_ms } = this.detail === DETAILS[DETAILS.length - 1] ? SOFTWARE : this.#limits;
    return period_ms === 0 ? 0
      : Math.min(Math.max(this.#cost_ms / MOST_SHARE, period_ms), SLOWEST_MS);
  }

  /**
   * Take note of what a picture took.
   *
   * @param {number} cost_ms until it was done
   * @param {number} now_ms
   * @returns {boolean} whether ratio or detail are others now
   */
  take(cost_ms, now_ms) {
    this.#cost_ms = cost_ms;
    if (this.sharp || now_ms - this.#changed_ms < EVERY_MS) {
      return false;
    }
    const share = cost_ms / BUDGET_MS;
    if (share > TOO_MUCH && this.#rung < RUNGS.length - 1) {
      const refused = this.#refused[this.#rung];
      refused.until_ms = now_ms + refused.for_ms;
      refused.for_ms *= 2;
      this.#rung += 1;
    } else if (share < PLENTY && this.#rung > 0
        && this.#refused[this.#rung - 1].until_ms <= now_ms) {
      this.#rung -= 1;
    } else {
      return false;
    }
    this.#changed_ms = now_ms;
    return true;
  }
}
