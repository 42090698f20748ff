// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * The quality of pictures, adapted so that drawing keeps up. It follows the measured cost, on any
 * machine. The renderer's name only provides a good first guess.
 */

/** The level of detail of a picture. */
export interface Detail {
  plain_m: number; // beyond it vehicles and trees have few triangles
  farthest_m: number; // beyond it no vehicle is drawn
  wheels_m: number; // beyond it wheels are discs on the flanks
  // whether the sky has a sun and a glow, and surfaces are as sharp as possible in the distance
  fine: boolean;
  mirrorEvery: number; // a mirror is drawn with each picture, or with each second one
}

/** From full detail to barely distinguishable things. */
export const DETAILS: Detail[] = [
  { plain_m: Infinity, farthest_m: 600, wheels_m: 600, fine: true, mirrorEvery: 1 },
  { plain_m: 60, farthest_m: 400, wheels_m: 90, fine: false, mirrorEvery: 1 },
  { plain_m: 30, farthest_m: 250, wheels_m: 50, fine: false, mirrorEvery: 2 },
];

/**
 * Share of the possible pixels in each direction, and index of the detail, from the best to the
 * cheapest.
 */
const RUNGS: [share: number, detail: number][] = [[1, 0], [0.85, 0], [0.7, 0], [0.7, 1], [0.6, 1],
  [0.5, 1], [0.42, 1], [0.42, 2], [0.35, 2], [0.3, 2], [0.25, 2]];
// Longest time until a picture is complete [ms].
const BUDGET_MS = 9;
// The first rung. Pictures drawn by the processor take time from the simulation on the same
// machine, so they have a least interval [ms].
const HARDWARE = { period_ms: 0, start: 0 };
const SOFTWARE = { period_ms: 33, start: 5 };
const FINEST = 2;
const TOO_MUCH = 1.2;
const PLENTY = 0.8;
const EVERY_MS = 800;
// A rung that was too expensive is tried again after this time, then after twice that, and so on.
const AGAIN_MS = 20_000;
// Largest share of the time that is spent on pictures.
const MOST_SHARE = 0.3;
const SLOWEST_MS = 50;

/** Names of renderers that are the processor itself. */
const SOFTWARE_NAMES = /swiftshader|llvmpipe|softpipe|software|basic render/i;

/** Return whether a renderer is the processor; `name` from WEBGL_debug_renderer_info. */
export function isSoftware(name: string): boolean {
  return SOFTWARE_NAMES.test(name);
}

/** The choice of a picture's pixel ratio and detail. */
export class Quality {
  #limits;
  #finest;
  #changed_ms = -Infinity;
  #rung;
  #cost_ms = 0;
  /** By rung: time before which it is not tried again, and how long it was refused. */
  #refused = RUNGS.map(() => ({ until_ms: -Infinity, for_ms: AGAIN_MS }));
  /** Whether full quality is kept, at any cost. */
  sharp = false;

  /**
   * @param software whether the processor draws
   * @param deviceRatio pixels of the screen to a CSS pixel
   */
  constructor(software: boolean, deviceRatio: number) {
    this.#limits = software ? SOFTWARE : HARDWARE;
    this.#finest = Math.min(deviceRatio, FINEST);
    this.#rung = this.#limits.start;
  }

  /** Return the pixels per CSS pixel. */
  get ratio() {
    return this.sharp ? this.#finest : RUNGS[this.#rung][0] * this.#finest;
  }

  /** Return the detail of pictures. */
  get detail() {
    return DETAILS[this.sharp ? 0 : RUNGS[this.#rung][1]];
  }

  /** Least time from picture to picture [ms]. */
  get period_ms() {
    // A renderer that has fallen this far is treated as a processor, whatever its name.
    const { period_ms } = this.detail === DETAILS[DETAILS.length - 1] ? SOFTWARE : this.#limits;
    return period_ms === 0 ? 0
      : Math.min(Math.max(this.#cost_ms / MOST_SHARE, period_ms), SLOWEST_MS);
  }

  /**
   * Record the cost of a picture.
   * @param cost_ms time until it was complete
   * @returns whether ratio or detail have changed
   */
  adjust(cost_ms: number, now_ms: number): boolean {
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

// Pictures between two measurements: waiting for the graphics card costs time, too.
const EVERY = 15;

/** A meter for some of the pictures of one context. */
export class FrameCost {
  #context;
  #count = 0;
  #begin_ms = 0;

  constructor(context: WebGLRenderingContext | WebGL2RenderingContext) {
    this.#context = context;
  }

  /** Begin a picture; return whether it is measured: then `end` is called. */
  begin(): boolean {
    this.#count += 1;
    if (this.#count % EVERY !== 0) {
      return false;
    }
    // Work submitted earlier does not belong to this picture.
    this.#wait();
    this.#begin_ms = performance.now();
    return true;
  }

  /** @returns time of the picture [ms] */
  end(): number {
    this.#wait();
    return performance.now() - this.#begin_ms;
  }

  /** Wait by reading a pixel, which completes all work; browsers do not wait at `finish`. */
  #wait() {
    const pixel = new Uint8Array(4);
    this.#context.readPixels(0, 0, 1, 1, this.#context.RGBA, this.#context.UNSIGNED_BYTE, pixel);
  }
}
