// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Chunks of a recorded run, fetched when needed; only some are kept. */

import { KIND } from '../frames.js';

import type { ReplayInfo } from '../api_messages.js';

// Number of chunks kept: a little more than two seeks and the way between them need; 5 s each.
const KEPT = 12;
const LENGTH_BYTES = 4;
const RETRY_MS = 1000;

/**
 * Read an answer of the server.
 * @param path below /api/replay/
 * @param query values by name
 * @throws {Error} with a readable text
 */
export async function ask(path: string, query: Record<string, number>): Promise<Response> {
  const values = Object.entries(query).map(([name, value]) => [name, `${value}`]);
  const answer = await fetch(`api/replay/${path}?${new URLSearchParams(values)}`);
  if (!answer.ok) {
    const { error } = await answer.json().catch(() => ({}));
    throw new Error(error ?? `The server answered ${answer.status}.`);
  }
  return answer;
}

/** Split packed frames; `packed`: frames, each after its length in bytes. */
export function unpack(packed: ArrayBuffer): ArrayBuffer[] {
  const view = new DataView(packed);
  const frames = [];
  for (let at = 0; at < packed.byteLength;) {
    const start = at + LENGTH_BYTES;
    at = start + view.getUint32(at, true);
    frames.push(packed.slice(start, at));
  }
  return frames;
}

/** A frame of a chunk. */
export interface Entry {
  at: number; // time from which it is shown [s]
  kind: number;
  slot: string; // of two entries with the same slot the later replaces the earlier
  buffer: ArrayBuffer; // the frame
}

/** The chunks of one run that are in memory. */
export class Chunks {
  #info;
  #chunks = new Map<number, Entry[]>();
  #asked = new Set<number>();
  #failed = new Map<number, number>();
  #loaded;
  #refused;

  /**
   * @param info of the run
   * @param loaded called after a chunk has come
   * @param refused called if one cannot be loaded
   */
  constructor(info: ReplayInfo, loaded: () => void, refused: (error: Error) => void) {
    this.#info = info;
    this.#loaded = loaded;
    this.#refused = refused;
  }

  /** Return how many chunks are in memory. */
  get size() {
    return this.#chunks.size;
  }

  /** Return the chunk that holds a time [s]. */
  numberAt(t: number): number {
    const { start_s, chunk_s, chunks } = this.#info;
    return Math.min(Math.max(Math.floor((t - start_s) / chunk_s + 1e-9), 0), chunks - 1);
  }

  /** Return the frames of a chunk, undefined before they have come. */
  get(number: number): Entry[] | undefined {
    return this.#chunks.get(number);
  }

  /**
   * Request a chunk and those after it.
   * @param number of the chunk that is shown
   * @param ahead how many more
   */
  want(number: number, ahead: number) {
    for (let i = number; i <= Math.min(number + ahead, this.#info.chunks - 1); i += 1) {
      const known = this.#chunks.get(i);
      if (known !== undefined) {
        // The map keeps the order of use: the first is the next to go.
        this.#chunks.delete(i);
        this.#chunks.set(i, known);
      } else if (!this.#asked.has(i) && !(performance.now() < (this.#failed.get(i) ?? NaN))) {
        this.#fetch(i);
      }
    }
  }

  async #fetch(number: number) {
    this.#asked.add(number);
    try {
      const answer = await ask('chunk', { i: number, epoch: this.#info.epoch });
      const entries = this.#entries(unpack(await answer.arrayBuffer()), number);
      this.#chunks.set(number, entries);
      this.#failed.delete(number);
      for (const oldest of [...this.#chunks.keys()].slice(0, -KEPT)) {
        this.#chunks.delete(oldest);
      }
    } catch (error) {
      this.#failed.set(number, performance.now() + RETRY_MS);
      this.#refused(error as Error);
      return;
    } finally {
      this.#asked.delete(number);
    }
    this.#loaded();
  }

  /** Return the time from which each frame is shown: a plan from the state that preceded it. */
  #entries(frames: ArrayBuffer[], number: number): Entry[] {
    let at = this.#info.start_s + number * this.#info.chunk_s - 1e-9;
    return frames.map((buffer) => {
      const [kind, , , , t, index, sensor] = new Float64Array(buffer);
      if (kind !== KIND.PLAN) {
        at = Math.max(at, t);
      }
      return { at, kind, slot: slotOf(kind, index, sensor), buffer };
    });
  }
}

/**
 * Return the slot of a frame, which a later frame replaces; each vehicle and sensor has its own.
 */
function slotOf(kind: number, index: number, sensor: number) {
  switch (kind) {
    case KIND.STATE: case KIND.OBJECTS: case KIND.OCCUPANCY: return `${kind}`;
    case KIND.SCAN: return `${kind}:${index}:${sensor}`;
    default: return `${kind}:${index}`;
  }
}
