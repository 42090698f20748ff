// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The AVs' plans: a line with dots that fade with time, and the swept width; predictions. */

import { PLAN_WIDTH, VEHICLE, VEHICLE_WIDTH } from '../frames.js';

import type { PlanFrame } from '../frames.js';
import type { Shown, Store } from '../store.js';
import type { LiveView, View } from './painter.js';
import type { DrawnVehicle, Thing, VehicleLayer } from './vehicle_layer.js';

// Dots are at multiples of this simulation time, so they stay in place if a new plan equals the
// one before [s].
const DOT_EVERY_S = 0.5;
const DOT_M = 0.26;
const DOT_PX = [1.8, 5];
const BAND_ALPHA = 0.22;
const FADED = 0.2;

/** Return the plans of the AVs that are present, without those that an event has hidden. */
export function shownPlans({ scene, fired, plans }: Store, shown: Shown): PlanFrame[] {
  const hidden = new Set<string>();
  for (const { name } of fired) {
    const event = scene?.events.find((entry) => entry.name === name);
    if (event?.kind === 'plan_display') {
      hidden[event.show ? 'delete' : 'add'](event.av);
    }
  }
  return [...plans.values()].filter(({ index }) => {
    const av = scene?.vehicles[index];
    return av !== undefined && !hidden.has(av.id)
      && Number.isFinite(shown.vehicles[index * VEHICLE_WIDTH]);
  });
}

export class PlanLayer {
  on = true;

  /** Draw the future part of each plan. */
  draw(context: CanvasRenderingContext2D, view: LiveView, vehicles: DrawnVehicle[]) {
    for (const plan of this.on ? shownPlans(view.store, view.shown) : []) {
      this.#drawPlan(context, view, plan, vehicles[plan.index]);
    }
  }

  #drawPlan(context: CanvasRenderingContext2D, view: LiveView, plan: PlanFrame,
    vehicle: DrawnVehicle) {
    const { shown, palette, camera, ratio } = view;
    const { points } = plan;
    const first = firstAfter(plan, shown.t);
    if (first >= points.length) {
      return;
    }
    const row = plan.index * VEHICLE_WIDTH;
    const x = shown.vehicles[row];
    const y = shown.vehicles[row + 1];
    camera.enterMap(context, ratio, x, y);
    context.fillStyle = palette[vehicle.color];
    context.strokeStyle = palette[vehicle.color];
    context.globalAlpha = BAND_ALPHA;
    addBand(context, points, first, x, y, shown.vehicles[row + VEHICLE.yaw], vehicle);
    context.fill();
    context.globalAlpha = 0.9;
    context.lineWidth = Math.max(0.1, 1.4 / camera.scale);
    context.lineJoin = 'round';
    context.beginPath();
    context.moveTo(0, 0);
    for (let i = first; i < points.length; i += PLAN_WIDTH) {
      context.lineTo(points[i] - x, points[i + 1] - y);
    }
    context.stroke();
    drawDots(context, view, plan, first, x, y);
    context.globalAlpha = 1;
  }
}

/** Return the index of the first value of the first point after a time [s]. */
function firstAfter({ t, points }: PlanFrame, now_t: number) {
  let i = 0;
  while (i < points.length && t + points[i + 4] <= now_t) {
    i += PLAN_WIDTH;
  }
  return i;
}

/** Add the band from the vehicle's current rear axle along the plan to its future front. */
function addBand(context: CanvasRenderingContext2D, points: Float64Array, first: number, x: number,
  y: number, yaw: number, { shape, rear_to_center: ahead }: DrawnVehicle) {
  const half = shape.width / 2;
  const last = points.length - PLAN_WIDTH;
  const nose = ahead + shape.length / 2;
  const endX = points[last] - x + nose * Math.cos(points[last + 2]);
  const endY = points[last + 1] - y + nose * Math.sin(points[last + 2]);
  // A corner of the band to the left (1) or right (-1) of a pose on the plan.
  const corner = (px: number, py: number, heading: number, side: number) => context.lineTo(
    px - side * half * Math.sin(heading), py + side * half * Math.cos(heading));
  context.beginPath();
  corner(0, 0, yaw, 1);
  for (let i = first; i <= last; i += PLAN_WIDTH) {
    corner(points[i] - x, points[i + 1] - y, points[i + 2], 1);
  }
  corner(endX, endY, points[last + 2], 1);
  corner(endX, endY, points[last + 2], -1);
  for (let i = last; i >= first; i -= PLAN_WIDTH) {
    corner(points[i] - x, points[i + 1] - y, points[i + 2], -1);
  }
  corner(0, 0, yaw, -1);
  context.closePath();
}

function drawDots(context: CanvasRenderingContext2D, { camera, shown }: LiveView,
  { t, points }: PlanFrame, first: number, x: number, y: number) {
  const radius = Math.min(Math.max(DOT_M, DOT_PX[0] / camera.scale), DOT_PX[1] / camera.scale);
  const horizon = t + points[points.length - 1] - shown.t;
  for (let i = Math.max(first, PLAN_WIDTH); i < points.length; i += PLAN_WIDTH) {
    const time = t + points[i + 4];
    const before = t + points[i + 4 - PLAN_WIDTH];
    if (Math.floor(time / DOT_EVERY_S + 1e-6) > Math.floor(before / DOT_EVERY_S + 1e-6)) {
      context.globalAlpha = 1 - (1 - FADED) * Math.min((time - shown.t) / horizon, 1);
      context.beginPath();
      context.arc(points[i] - x, points[i + 1] - y, radius, 0, 2 * Math.PI);
      context.fill();
    }
  }
}

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
