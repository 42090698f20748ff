// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The rays of an AV's sensors: a fan up to what they hit, and the line of the hits. */

import type { Scan, ScanFrame } from '../frames.js';
import type { LiveView } from '../world/painter.js';

const FAN_ALPHA = 0.13;
const HIT_ALPHA = 0.95;
const HIT_PX = 2;
// A full circle has no apex.
const FULL = 2 * Math.PI - 0.05;
// Hits of neighbouring rays belong together if they are this near, or nearer than four steps
// across the rays [m].
const TOGETHER_M = 0.6;
const STEPS = 4;
// Drawn length of a single hit [m].
const DOT_M = 0.15;

export interface Paths { fan: Path2D; hits: Path2D }

/** The layer that draws the scans of one AV, with paths built once per scan. */
export class RayLayer {
  /** Number of fans drawn in the last frame. */
  drawn = 0;
  #paths = new WeakMap<ScanFrame, Paths>();

  /**
   * Draw the scans of an AV at the poses of their sensors at the time of the scan.
   * @param view as layers get it
   * @param av index of the AV; -1 draws nothing
   */
  draw(context: CanvasRenderingContext2D, { camera, palette, ratio, store, shown }: LiveView,
    av: number) {
    const scans = av < 0 ? [] : store.perceived.scansOf(av, shown.t);
    this.drawn = scans.length;
    for (const scan of scans) {
      const { fan, hits } = this.#pathsOf(scan);
      camera.enterMap(context, ratio, scan.x, scan.y);
      context.fillStyle = palette.ray;
      context.globalAlpha = FAN_ALPHA;
      context.fill(fan);
      context.strokeStyle = palette.ray;
      context.globalAlpha = HIT_ALPHA;
      context.lineWidth = HIT_PX / camera.scale;
      context.stroke(hits);
    }
  }

  #pathsOf(scan: ScanFrame): Paths {
    let paths = this.#paths.get(scan);
    if (paths === undefined) {
      paths = build(scan);
      this.#paths.set(scan, paths);
    }
    return paths;
  }
}

/** Build the paths in metres around the sensor, along the axes of the map. */
function build({ yaw, first, increment, longest, ranges }: Scan): Paths {
  const fan = new Path2D();
  const hits = new Path2D();
  const count = ranges.length;
  if (Math.abs(increment) * count < FULL) {
    fan.moveTo(0, 0);
  }
  let before = Infinity;
  for (let i = 0; i < count; i += 1) {
    const angle = yaw + first + i * increment;
    const range = ranges[i];
    const reach = Math.min(range, longest);
    const x = reach * Math.cos(angle);
    const y = reach * Math.sin(angle);
    fan.lineTo(x, y);
    if (range <= longest) {
      if (Math.abs(range - before) < Math.max(TOGETHER_M, STEPS * increment * range)) {
        hits.lineTo(x, y);
      } else {
        hits.moveTo(x, y);
        hits.lineTo(x + DOT_M, y);
        hits.moveTo(x, y);
      }
    }
    before = range <= longest ? range : Infinity;
  }
  fan.closePath();
  return { fan, hits };
}
