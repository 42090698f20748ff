// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The drawing of unseen things: dashed outlines, and a ring around people. */

import type { View } from './painter.js';
import type { Thing } from './vehicle_layer.js';

const FILL_ALPHA = 0.1;
const LINE_PX = 1.8;
const DASH_PX = [4, 3];
// Radius of the ring around a person, who is small [px].
const RING_PX = 7;
const RING_DASH_PX = [5, 4];

/**
 * Draw the outline of a thing.
 * @param view camera, palette and ratio
 * @param thing with its look and color
 * @param x of its centre [m]
 * @param y [m]
 * @param yaw [rad]
 * @param leastPx its least length on the screen [px]
 * @returns factor by which it is enlarged
 */
export function drawOutline(context: CanvasRenderingContext2D,
  { camera, palette, ratio }: Pick<View, 'camera' | 'palette' | 'ratio'>, thing: Thing, x: number,
  y: number, yaw: number, leastPx: number): number {
  const { look } = thing;
  const factor = Math.max(1, leastPx / (look.extent * camera.scale));
  const pixel = 1 / (camera.scale * factor);
  camera.enterPose(context, ratio, x, y, yaw, factor);
  context.fillStyle = palette[thing.color];
  context.globalAlpha = FILL_ALPHA;
  context.fill(look.body);
  context.globalAlpha = 1;
  context.strokeStyle = palette[thing.color];
  context.lineWidth = LINE_PX * pixel;
  context.setLineDash(DASH_PX.map((length) => length * pixel));
  context.stroke(look.body);
  if (thing.color === 'vulnerable') {
    context.setLineDash(RING_DASH_PX.map((length) => length * pixel));
    context.beginPath();
    context.arc(0, 0, 0.5 * look.extent + RING_PX * pixel, 0, 2 * Math.PI);
    context.stroke();
  }
  context.setLineDash([]);
  return factor;
}
