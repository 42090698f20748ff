// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** What a picture takes until it is done, not only until it was ordered. */

// So many pictures, then one is measured: to wait for the graphics card costs time, too.
const EVERY = 15;

/** Measures some of the pictures of one context. */
export class FrameCost {
  #context;
  #count = 0;
  #begin_ms = 0;

  /** @param {WebGLRenderingContext|WebGL2RenderingContext} context */
  constructor(context) {
    this.#context = context;
  }

  /**
   * Begin a picture.
   *
   * @returns {boolean} whether it is measured: then `end` is called
   */
  begin() {
    this.#count += 1;
    if (this.#count % EVERY !== 0) {
      return false;
    }
    // What was ordered before is not this picture's.
    this.#wait();
    this.#begin_ms = performance.now();
    return true;
  }

  /**
   * @returns {number} what the picture took [ms]
   */
  end() {
    this.#wait();
    return performance.now() - this.#begin_ms;
  }

  /** To read a pixel takes until all before is done; browsers don't wait at `finish`. */
  #wait() {
    const pixel = new Uint8Array(4);
    this.#context.readPixels(0, 0, 1, 1, this.#context.RGBA, this.#context.UNSIGNED_BYTE, pixel);
  }
}
