// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Measurement of the time until a picture is complete, not only until it was submitted. */

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
