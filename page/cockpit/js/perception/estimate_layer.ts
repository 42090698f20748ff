// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The estimated pose of an AV: an outline, and the ellipse of two standard deviations. */

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
