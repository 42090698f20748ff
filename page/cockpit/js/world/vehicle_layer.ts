// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The layer of humans' vehicles, AVs, obstacles and pedestrians at their current poses. */

import { OBJECT_WIDTH, VEHICLE, VEHICLE_WIDTH } from '../frames.js';
import { LIGHT, shining } from '../lights.js';
import { BrakeLights } from './brake_lights.js';
import { colorNameOf } from './palette.js';
import { TYRE, vehicleLook } from './vehicle_shape.js';

import type { Pose, Scene, SceneObject, SceneVehicle } from '../messages.js';
import type { Shown } from '../store.js';
import type { LiveView, View } from './painter.js';
import type { ColorName } from './palette.js';
import type { Look } from './vehicle_shape.js';

// Least length of things on the screen [px]: driven vehicles, people
// on foot or bicycles, and all others.
const LEAST_PX: Record<string, number> = { driven: 15, vulnerable: 14, other: 6 };
// Below this length on the screen only the body of a thing is drawn [px].
const DETAIL_PX = 13;
const TYRE_INSET_M = 0.2;
const BLUE_LIGHTS = new Path2D('M-.2-.65h.4v.5h-.4zM-.2 .15h.4v.5h-.4z');
const SHADOW_PX = 2;

export interface Appearance { look: Look; color: ColorName }
export type DrawnVehicle = SceneVehicle & Appearance;
export type DrawnObject = SceneObject & Appearance;
/** A vehicle or an object. */
export interface Thing extends Appearance { id: string; rear_to_center?: number }
export type ChooseHollow = (view: LiveView) => Uint8Array | null;

/** Everything that has a pose. */
export class VehicleLayer {
  // In the order of STATE and OBJECTS.
  vehicles: DrawnVehicle[] = [];
  objects: DrawnObject[] = [];
  /** Chooses in each frame which things are drawn hollow; see World.drawHollow. */
  hollow: ChooseHollow = () => null;
  brakeLights = new BrakeLights();

  load(scene: Scene) {
    this.vehicles = scene.vehicles.map((vehicle) => ({
      ...vehicle, look: vehicleLook(vehicle.type, vehicle.shape, true),
      color: colorNameOf(vehicle),
    }));
    this.objects = scene.objects.map((object) => ({
      ...object, look: vehicleLook(object.type, object.shape, object.role !== 'static'),
      color: colorNameOf(object),
    }));
    this.brakeLights.load(this.objects.length);
  }

  /**
   * Return the pose of the centre of a driven vehicle or an object in the frame shown last.
   * @param id of it
   * @param shown of Store.displayed
   * @returns null while it is absent
   */
  poseOf(id: string, shown: Shown): Pose | null {
    const index = this.vehicles.findIndex((vehicle) => vehicle.id === id);
    if (index >= 0) {
      return centerOf(this.vehicles[index], shown.vehicles, index);
    }
    const row = OBJECT_WIDTH * this.objects.findIndex((object) => object.id === id);
    return row >= 0 && Number.isFinite(shown.objects[row])
      ? {
        x: shown.objects[row], y: shown.objects[row + 1], yaw: shown.objects[row + 2],
        speed: Math.hypot(shown.objects[row + 3], shown.objects[row + 4]),
      } : null;
  }

  /**
   * Return the vehicle or object at a point of the canvas.
   * @returns the id of the nearest within a finger's reach
   */
  pick(px: number, py: number, { camera, shown }: LiveView): string | null {
    let best = null;
    let reach = 24;
    for (const { id, look } of [...this.vehicles, ...this.objects]) {
      const pose = this.poseOf(id, shown);
      const distance = pose === null ? Infinity
        : Math.hypot(camera.toX(pose.x, pose.y) - px, camera.toY(pose.x, pose.y) - py)
          - 0.4 * look.extent * camera.scale;
      if (distance < reach) {
        reach = distance;
        best = id;
      }
    }
    return best;
  }

  /** Draw objects, then the driven vehicles over them. */
  draw(context: CanvasRenderingContext2D, view: LiveView) {
    const { camera, shown, ratio, store } = view;
    const hollow = this.hollow(view);
    for (let i = 0; i < this.objects.length; i += 1) {
      const row = i * OBJECT_WIDTH;
      const x = shown.objects[row];
      const y = shown.objects[row + 1];
      const object = this.objects[i];
      if (camera.sees(x, y, object.look.radius)) {
        const leastPx = LEAST_PX[object.color] ?? LEAST_PX.other;
        if (hollow?.[this.vehicles.length + i]) {
          drawOutline(context, view, object, x, y, shown.objects[row + 2], leastPx);
        } else {
          const yaw = shown.objects[row + 2];
          const lights = store.signals.objects[object.id] ?? 0;
          const factor = drawLook(context, view, object, x, y, yaw,
            this.brakeLights.ofObject(i) || (lights & LIGHT.brake) > 0, leastPx);
          if (lights > 0) {
            camera.enterPose(context, ratio, x, y, yaw, factor);
            drawLights(context, view, object, lights);
          }
        }
      }
    }
    for (let i = 0; i < this.vehicles.length; i += 1) {
      this.#drawVehicle(context, view, i, Boolean(hollow?.[i]));
    }
  }

  #drawVehicle(context: CanvasRenderingContext2D, view: LiveView, index: number, hollow: boolean) {
    const { camera, shown, ratio, palette, store } = view;
    const vehicle = this.vehicles[index];
    const row = index * VEHICLE_WIDTH;
    const yaw = shown.vehicles[row + VEHICLE.yaw];
    const x = shown.vehicles[row] + vehicle.rear_to_center * Math.cos(yaw);
    const y = shown.vehicles[row + 1] + vehicle.rear_to_center * Math.sin(yaw);
    if (!camera.sees(x, y, vehicle.look.radius)) {
      return;
    }
    const factor = hollow
      ? drawOutline(context, view, vehicle, x, y, yaw, LEAST_PX.driven)
      : drawLook(context, view, vehicle, x, y, yaw,
        this.brakeLights.ofVehicle(shown.vehicles, row), LEAST_PX.driven);
    if (!hollow && vehicle.look.extent * camera.scale > 2 * DETAIL_PX) {
      drawTyres(context, view, vehicle, x, y, yaw,
        shown.vehicles[row + VEHICLE.steering_angle]);
    }
    if (!hollow && shown.vehicles[row + VEHICLE.lights] > 0) {
      camera.enterPose(context, ratio, x, y, yaw, factor);
      drawLights(context, view, vehicle, shown.vehicles[row + VEHICLE.lights]);
    }
    const trouble = store.status?.drivability?.[vehicle.id];
    if (trouble?.collision || store.holds(vehicle.id)) {
      camera.enterPose(context, ratio, x, y, yaw, factor);
      context.strokeStyle = trouble?.collision ? palette.alarm : palette.label;
      context.lineWidth = (trouble?.collision ? 3.5 : 1.6) / (camera.scale * factor);
      context.stroke(vehicle.look.body);
    }
  }
}

function drawLook(context: CanvasRenderingContext2D, { camera, palette, ratio }: View,
  thing: Thing, x: number, y: number, yaw: number, braking: boolean, leastPx: number) {
  const { look } = thing;
  const factor = Math.max(1, leastPx / (look.extent * camera.scale));
  const detailed = look.extent * camera.scale > DETAIL_PX;
  if (detailed) {
    camera.enterPose(context, ratio, x, y, yaw, factor, SHADOW_PX);
    context.fillStyle = palette.shadow;
    context.fill(look.body);
  }
  camera.enterPose(context, ratio, x, y, yaw, factor);
  context.fillStyle = palette[thing.color];
  context.fill(look.body);
  context.strokeStyle = palette.outline;
  context.lineWidth = (detailed ? 1 : 0.6) / (camera.scale * factor);
  context.stroke(look.body);
  if (look.glass !== null && detailed) {
    context.fillStyle = palette.glass;
    context.fill(look.glass);
  }
  if (look.roof !== null && detailed) {
    context.fillStyle = palette[thing.color];
    context.fill(look.roof);
  }
  if (look.lamps !== null && detailed) {
    context.fillStyle = palette.lamp;
    context.fill(look.lamps);
  }
  if (look.brakes !== null && (braking || detailed)) {
    context.fillStyle = braking ? palette.brake : palette.glass;
    context.fill(look.brakes);
  }
  return factor;
}

/** Draw the front wheels, turned by the steering angle. */
function drawTyres(context: CanvasRenderingContext2D, { camera, ratio, palette }: View,
  vehicle: DrawnVehicle, x: number, y: number, yaw: number, steering: number) {
  const aside = vehicle.shape.width / 2 - TYRE_INSET_M;
  context.fillStyle = palette.outline;
  context.strokeStyle = palette.kerb;
  context.lineWidth = 0.05;
  const along = vehicle.wheelbase - vehicle.rear_to_center;
  for (let left = -aside; left <= aside; left += 2 * aside) {
    camera.enterPose(context, ratio,
      x + along * Math.cos(yaw) - left * Math.sin(yaw),
      y + along * Math.sin(yaw) + left * Math.cos(yaw), yaw + steering);
    context.fill(TYRE);
    context.stroke(TYRE);
  }
}

/**
 * Draw indicators at the corners, blue lights on the roof, and the horn as arcs ahead.
 * @param context in the vehicle's coordinates
 */
function drawLights(context: CanvasRenderingContext2D, { shown, palette }: LiveView,
  { look }: Thing, lights: number) {
  const { left, right, horn, blue } = shining(lights, shown.t);
  context.fillStyle = palette.indicator;
  context.strokeStyle = palette.outline;
  context.lineWidth = 0.08;
  for (const [on, path] of [
    [left, look.indicators?.left], [right, look.indicators?.right]] as const) {
    if (on && path !== undefined) {
      context.fill(path);
      context.stroke(path);
    }
  }
  if (blue) {
    context.fillStyle = palette.blue;
    context.fill(BLUE_LIGHTS);
    context.stroke(BLUE_LIGHTS);
  }
  if (horn) {
    context.strokeStyle = palette.indicator;
    context.lineWidth = 0.25;
    for (const away of [0.8, 1.6]) {
      context.beginPath();
      context.arc(look.extent / 2 - 0.6, 0, 0.6 + away, -0.7, 0.7);
      context.stroke();
    }
  }
}

function centerOf({ rear_to_center: ahead }: SceneVehicle, rows: Float64Array,
  index: number): Pose | null {
  const row = index * VEHICLE_WIDTH;
  const yaw = rows[row + VEHICLE.yaw];
  return Number.isFinite(rows[row])
    ? {
      x: rows[row] + ahead * Math.cos(yaw), y: rows[row + 1] + ahead * Math.sin(yaw), yaw,
      speed: Math.abs(rows[row + VEHICLE.speed]),
    } : null;
}

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
function drawOutline(context: CanvasRenderingContext2D,
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
