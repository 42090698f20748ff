// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Predictions in the planners' requests: lines that end in an outline. */

import type { LiveView, View } from './painter.js';
import type { Thing, VehicleLayer } from './vehicle_layer.js';

const STRIDE = 3;
const LINE_ALPHA = 0.65;
const END_ALPHA = 0.8;

/** The layer of predictions in the AVs' requests; off by default. */
export class PredictionLayer {
  /** Whether predictions are shown. */
  on = false;

  /** Draw the future part of each prediction. */
  draw(context: CanvasRenderingContext2D, view: LiveView, layer: VehicleLayer) {
    if (!this.on) {
      return;
    }
    for (const prediction of view.store.predictions.values()) {
      const dt_c = view.scene.time.dt_c_s;
      const passed = Math.max(Math.ceil((view.shown.t - prediction.t) / dt_c), 0);
      if (passed < prediction.steps) {
        for (const { column, points } of prediction.entries) {
          const thing = column < layer.vehicles.length ? layer.vehicles[column]
            : layer.objects[column - layer.vehicles.length];
          if (thing !== undefined && layer.poseOf(thing.id, view.shown) !== null) {
            drawEntry(context, view, thing, points, passed * STRIDE);
          }
        }
      }
    }
    context.globalAlpha = 1;
  }
}

function drawEntry(context: CanvasRenderingContext2D, { camera, ratio, palette }: View,
  thing: Thing, points: Float64Array, first: number) {
  const last = points.length - STRIDE;
  const x = points[first];
  const y = points[first + 1];
  const length = Math.hypot(points[last] - x, points[last + 1] - y);
  if (!(length > 0.5) || !camera.sees(x, y, length + thing.look.radius)) {
    return;
  }
  camera.enterMap(context, ratio, x, y);
  context.strokeStyle = palette[thing.color];
  context.globalAlpha = LINE_ALPHA;
  context.lineWidth = Math.max(0.12, 1.6 / camera.scale);
  context.beginPath();
  context.moveTo(0, 0);
  for (let i = first + STRIDE; i <= last; i += STRIDE) {
    context.lineTo(points[i] - x, points[i + 1] - y);
  }
  context.stroke();
  const ahead = thing.rear_to_center ?? 0;
  camera.enterPose(context, ratio, points[last] + ahead * Math.cos(points[last + 2]),
    points[last + 1] + ahead * Math.sin(points[last + 2]), points[last + 2]);
  context.globalAlpha = END_ALPHA;
  context.lineWidth = 1.3 / camera.scale;
  context.stroke(thing.look.body);
}
