// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The sounds that the driver of one vehicle hears, own and near. No sound is made here. */

import { OBJECT_WIDTH, VEHICLE, VEHICLE_WIDTH } from '../frames.js';
import {
  CAR, ELECTRIC, engineSpeed_rpm, gearAfter, HEAVY, MUSCLE, REVERSE,
} from './drive_train.js';
import { arrival, RANGE_M } from './hearing.js';

import type { Scene, SceneObject, SceneVehicle } from '../messages.js';
import type { Shown } from '../store.js';
import type { DriveTrain } from './drive_train.js';
import type { Arrival, Moving } from './hearing.js';

/** Most others that are heard at once, the nearest. */
export const MOST_OTHERS = 6;

// A longer vehicle is a lorry or a bus [m].
const LONG_M = 7.5;
// Without a known pedal the throttle is estimated: the share that holds a speed, less below some
// speed [m/s], and the share per acceleration [s^2/m].
const HOLDING = 0.15;
const HELD_FROM = 5;
const THROTTLE_PER_ACCELERATION = 0.25;
// CommonRoad's types other than cars; null has no engine.
const TYPES: Record<string, DriveTrain | null | undefined> = {
  truck: HEAVY, bus: HEAVY, bicycle: null, pedestrian: null, parkedVehicle: null, train: null,
  constructionZone: null, roadBoundary: null, building: null, pillar: null, median_strip: null,
};

/** The own vehicle. */
export interface Driven {
  id: string;
  train: DriveTrain;
  gear: number; // index of a ratio, or REVERSE
  rpm: number;
  load: number; // of the engine, 0 to 1
  speed: number; // without a sign [m/s]
  deceleration: number; // against the motion [m/s^2]
  lateral: number; // acceleration, to the left [m/s^2]
  lights: number; // bits of LIGHT
}

/** A vehicle nearby. */
export interface Other extends Arrival {
  id: string;
  train: DriveTrain;
  rpm: number;
  speed: number;
  lights: number;
}

export interface Heard { t: number; own: Driven; others: Other[] }

/** The listener in one vehicle, which keeps the gears of all. */
export class Listener {
  #gears = new Map<string, number>();

  /** Clear the gears before another run. */
  reset() {
    this.#gears.clear();
  }

  /**
   * Return the sounds that are heard.
   * @param shown rows of the same time
   * @param id of the vehicle or object whose driver listens
   * @returns null if there is no such vehicle now
   */
  hear(scene: Scene, { t, vehicles, objects }: Shown, id: string): Heard | null {
    const index = scene.vehicles.findIndex((vehicle) => vehicle.id === id);
    const column = index < 0 ? scene.objects.findIndex((object) => object.id === id) : -1;
    if (index < 0 && column < 0) {
      return null;
    }
    const own = index >= 0 ? this.#driven(scene.vehicles[index], vehicles, index)
      : this.#passenger(scene.objects[column], objects, column);
    const ear = index >= 0 ? pointOf(vehicles, index, scene.vehicles[index].driver_place.eye)
      : objectAt(objects, column);
    if (own === null || !Number.isFinite(ear.x)) {
      return null;
    }
    return { t, own, others: this.#others(scene, vehicles, objects, id, ear) };
  }

  #driven(vehicle: SceneVehicle, rows: Float64Array, index: number): Driven | null {
    const at = index * VEHICLE_WIDTH;
    const signed = rows[at + VEHICLE.speed];
    if (!Number.isFinite(signed)) {
      return null;
    }
    const train = trainOf(vehicle);
    const along = (rows[at + VEHICLE.acceleration] || 0) * (Math.sign(signed) || 1);
    const pedal = rows[at + VEHICLE.throttle];
    const throttle = Number.isFinite(pedal) ? pedal : guessThrottle(Math.abs(signed), along);
    const reverse = signed < 0 || (signed === 0 && rows[at + VEHICLE.reverse] > 0.5);
    const speed = Math.abs(signed);
    return {
      id: vehicle.id, train, ...this.#engine(vehicle.id, train, speed, throttle, reverse),
      load: throttle, speed, deceleration: -along,
      lateral: signed * (rows[at + VEHICLE.yaw_rate] || 0), lights: rows[at + VEHICLE.lights] || 0,
    };
  }

  /** @returns null for an object without a driver's seat */
  #passenger(object: SceneObject, rows: Float64Array, column: number): Driven | null {
    const train = trainOfObject(object);
    const { vx, vy } = objectAt(rows, column);
    const speed = Math.hypot(vx, vy);
    const throttle = guessThrottle(speed, 0);
    return train === null || !Number.isFinite(speed) ? null : {
      id: object.id, train, ...this.#engine(object.id, train, speed, throttle, false),
      load: throttle, speed, deceleration: 0, lateral: 0, lights: 0,
    };
  }

  #engine(id: string, train: DriveTrain, speed: number, throttle: number, reverse: boolean) {
    const gear = reverse ? REVERSE : gearAfter(train, this.#gears.get(id) ?? 0, speed, throttle);
    this.#gears.set(id, gear);
    return { gear, rpm: engineSpeed_rpm(train, gear, speed, throttle) };
  }

  /** @returns the nearest first */
  #others(scene: Scene, vehicles: Float64Array, objects: Float64Array, id: string,
    ear: Moving): Other[] {
    const all: { id: string; train: DriveTrain; source: Moving; lights: number }[] = [];
    scene.vehicles.forEach((vehicle, index) => {
      all.push({ id: vehicle.id, train: trainOf(vehicle),
        source: pointOf(vehicles, index, [vehicle.rear_to_center, 0]),
        lights: vehicles[index * VEHICLE_WIDTH + VEHICLE.lights] || 0 });
    });
    scene.objects.forEach((object, column) => {
      const train = trainOfObject(object);
      if (train !== null) {
        all.push({ id: object.id, train, source: objectAt(objects, column), lights: 0 });
      }
    });
    return all
      .filter((other) => other.id !== id && Number.isFinite(other.source.x + other.source.vx))
      .map(({ source, ...other }) => ({ ...other, ...arrival(ear, source),
        speed: Math.hypot(source.vx, source.vy) }))
      .filter(({ distance }) => distance < RANGE_M)
      .sort((a, b) => a.distance - b.distance).slice(0, MOST_OTHERS)
      .map((other) => ({ ...other,
        rpm: this.#engine(other.id, other.train, other.speed, guessThrottle(other.speed, 0), false)
          .rpm }));
  }
}

function trainOf(vehicle: SceneVehicle): DriveTrain {
  return vehicle.powertrain === 'muscle' ? MUSCLE
    : vehicle.powertrain === 'electric' ? ELECTRIC
      : vehicle.shape.length > LONG_M ? HEAVY : CAR;
}

/** @returns null without an engine */
function trainOfObject({ type, role, shape }: SceneObject): DriveTrain | null {
  const known = TYPES[type];
  return role === 'static' || known === null ? null
    : known ?? (shape.length > LONG_M ? HEAVY : CAR);
}

/** `speed` without a sign [m/s]; `acceleration`: along the motion [m/s^2]. */
function guessThrottle(speed: number, acceleration: number) {
  const holding = HOLDING * Math.min(speed / HELD_FROM, 1);
  return Math.min(Math.max(holding + THROTTLE_PER_ACCELERATION * acceleration, 0), 1);
}

/** Return a point of a vehicle: its middle, its driver's eye; from its rear axle [m]. */
function pointOf(rows: Float64Array, index: number, [ahead, left]: number[]): Moving {
  const at = index * VEHICLE_WIDTH;
  const [yaw, speed] = [rows[at + VEHICLE.yaw], rows[at + VEHICLE.speed]];
  const [cos, sin] = [Math.cos(yaw), Math.sin(yaw)];
  return {
    x: rows[at + VEHICLE.x] + ahead * cos - left * sin,
    y: rows[at + VEHICLE.y] + ahead * sin + left * cos,
    yaw, vx: speed * cos, vy: speed * sin,
  };
}

function objectAt(rows: Float64Array, column: number): Moving {
  const [x, y, yaw, vx, vy] = rows.subarray(column * OBJECT_WIDTH, (column + 1) * OBJECT_WIDTH);
  return { x, y, yaw, vx, vy };
}
