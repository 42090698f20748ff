// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** An AV's estimated pose: outline and ellipse of two standard deviations; its sensors' rays. */

import type { Scan, ScanFrame } from '../frames.js';
import type { ShownEstimate } from '../perceived.js';
import type { LiveView } from '../world/painter.js';
import type { DrawnVehicle } from '../world/vehicle_layer.js';

const SIGMAS = 2;
const LINE_PX = 1.8;
const DASH_PX = [6, 3];
const FILL_ALPHA = 0.25;
const CROSS_PX = 4;

/** Half axes [m], direction of the major one in the map [rad]. */
export interface Ellipse { major: number; minor: number; angle: number }

/** The layer that draws the estimate of one AV. */
export class EstimateLayer {
  /** The estimate drawn last, null for none. */
  drawn: (ShownEstimate & Partial<Ellipse>) | null = null;

  /**
   * Draw the estimate.
   * @param view as layers get it
   * @param vehicle of the vehicle layer, that of the AV
   * @param av its index; -1 draws nothing
   */
  draw(context: CanvasRenderingContext2D, { camera, palette, ratio, store, shown }: LiveView,
    vehicle: DrawnVehicle | undefined, av: number) {
    const estimate = av < 0 ? null : store.perceived.estimateOf(av, shown.t);
    this.drawn = estimate;
    if (estimate === null || vehicle === undefined) {
      return;
    }
    const { x, y, yaw } = estimate;
    const pixel = 1 / camera.scale;
    context.strokeStyle = palette.estimate;
    context.lineWidth = LINE_PX * pixel;
    camera.enterPose(context, ratio, x + vehicle.rear_to_center * Math.cos(yaw),
      y + vehicle.rear_to_center * Math.sin(yaw), yaw);
    context.setLineDash(DASH_PX.map((length) => length * pixel));
    context.stroke(vehicle.look.body);
    context.setLineDash([]);
    const axes = ellipse(estimate);
    Object.assign(estimate, axes);
    camera.enterPose(context, ratio, x, y, axes.angle);
    context.beginPath();
    context.ellipse(0, 0, axes.major, axes.minor, 0, 0, 2 * Math.PI);
    context.fillStyle = palette.estimate;
    context.globalAlpha = FILL_ALPHA;
    context.fill();
    context.globalAlpha = 1;
    context.stroke();
    context.beginPath();
    context.moveTo(-CROSS_PX * pixel, 0);
    context.lineTo(CROSS_PX * pixel, 0);
    context.moveTo(0, -CROSS_PX * pixel);
    context.lineTo(0, CROSS_PX * pixel);
    context.stroke();
  }
}

/** Return the ellipse of two standard deviations of a covariance; `covariance` [m^2]. */
export function ellipse({ xx, xy, yy }: { xx: number; xy: number; yy: number }): Ellipse {
  const mean = (xx + yy) / 2;
  const spread = Math.hypot((xx - yy) / 2, xy);
  return {
    major: SIGMAS * Math.sqrt(Math.max(mean + spread, 0)),
    minor: SIGMAS * Math.sqrt(Math.max(mean - spread, 0)),
    angle: 0.5 * Math.atan2(2 * xy, xx - yy),
  };
}

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

interface Paths { fan: Path2D; hits: Path2D }

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
