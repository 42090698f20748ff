// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** All vehicles and objects as bodies, at their current poses. */

import { OBJECT_WIDTH, VEHICLE, VEHICLE_WIDTH } from '../frames.js';
import { shining } from '../lights.js';
import { BrakeLights } from '../world/brake_lights.js';
import { colorNameOf, themeColor } from '../world/palette.js';
import { ofObject, ofVehicle } from './bodies/appearance.js';
import { plainBody } from './bodies/plain_bodies.js';
import { FittedParts } from './fitted_parts.js';
import { Headlights } from './headlights.js';
import { Instances } from './instances.js';

import type { Group } from 'three';
import type { Scene, SceneObject } from '../messages.js';
import type { Shown, Store } from '../store.js';
import type { Appearance } from './bodies/appearance.js';
import type { Body } from './bodies/motor_vehicles.js';
import type { Named } from './contents.js';
import type { Origin } from './local_origin.js';
import type { Sight } from './seen_instances.js';
import type { Triple } from './solid_boxes.js';
import type { Three } from './three.js';

export interface Thing {
  id: string;
  look: Appearance;
  body: Body;
  instances: Instances;
  scale: [x: number, y: number, z: number]; // of the body
  role: number; // its colour on the map
  rolled: number; // distance of its wheels [m]
  wheelbase: number; // of the body as it is scaled; 0 without wheels [m]
  parked: boolean; // whether it is parked, without a driver
  kind: PlacedBody['kind'];
  bounds: { low: Triple; high: Triple } | null; // of its body, once they were asked for [m]
}

/** A body where it was placed last. */
export interface PlacedBody extends Named { own: boolean }

export type HeightAt = (x: number, y: number) => number; // of the road at a point of the map [m]

/** The bodies of one scene. */
export class Traffic {
  /** Whether bodies have the map's colours, which show what drives them. */
  byRole = false;
  keepsPlaces = false;
  /** The bodies as they were placed last; null while they are not kept. */
  placed: PlacedBody[] | null = null;
  #three;
  /** Distances beyond which no body is drawn, and no wheel turns [m]. */
  limits = { farthest_m: 0, wheels_m: 0 };
  #group;
  #vehicles: Thing[] = [];
  #objects: Thing[] = [];
  #instances = new Map<string, Instances>();
  #parts;
  #headlights;
  #brakeLights = new BrakeLights();
  #matrix;
  #scaling;
  #origin: Origin = { x: 0, y: 0 };
  #scene: Scene | null = null;
  #shown_t = NaN;
  #store;

  /**
   * @param group gets everything
   * @param store whose scenario steps and signals show which objects brake or indicate
   */
  constructor(three: Three, group: Group, store: Store) {
    this.#three = three;
    this.#group = group;
    this.#matrix = new three.Matrix4();
    this.#scaling = new three.Vector3();
    this.#parts = new FittedParts(three, group);
    this.#headlights = new Headlights(three, group);
    this.#store = store;
    store.on('objects', (step) => this.#brakeLights.update(step));
  }

  /** @param origin of the coordinates in the group */
  load(scene: Scene, origin: Origin) {
    this.#clear();
    this.#scene = scene;
    this.#origin = origin;
    this.#brakeLights.load(scene.objects.length);
    const kinds = new Map<string, { look: Appearance; count: number }>();
    const looks = [...scene.vehicles.map(ofVehicle), ...scene.objects.map(ofObject)];
    for (const look of looks) {
      kinds.set(look.key, { look, count: (kinds.get(look.key)?.count ?? 0) + 1 });
    }
    const bodies = new Map<string, Body>();
    for (const [key, { look, count }] of kinds) {
      const body = look.build();
      bodies.set(key, body);
      this.#instances.set(key, new Instances(this.#three, this.#group, body.mesh, count,
        plainBody(look.key, body)));
    }
    const colors = new Map<string, number>();
    const things = [...scene.vehicles, ...scene.objects].map((thing, i) => {
      const name = colorNameOf(thing);
      const color = colors.get(name) ?? new this.#three.Color(themeColor(name)).getHex();
      colors.set(name, color);
      return this.#thing(looks[i], bodies.get(looks[i].key) as Body, thing.id, color);
    });
    this.#vehicles = things.slice(0, scene.vehicles.length);
    this.#objects = things.slice(scene.vehicles.length);
    things.forEach((thing, i) => {
      const object = scene.objects[i - scene.vehicles.length] as SceneObject | undefined;
      thing.parked = object?.role === 'static';
      thing.kind = object === undefined ? 'vehicle' : kindOf(object.type, thing.body);
    });
    this.#parts.load(things.length);
    this.#headlights.load(scene.environment, things.length);
  }

  /**
   * Place all bodies at their current poses.
   * @param own id of the vehicle in which the camera may be
   * @param eye of the camera, in the group's coordinates
   */
  update(shown: Shown, own: string | null, heightAt: HeightAt, eye: { x: number; y: number }) {
    const scene = this.#scene;
    if (scene === null) {
      return;
    }
    const dt = this.#elapsed(shown.t);
    for (const instances of this.#instances.values()) {
      instances.clear();
    }
    this.#parts.clear();
    this.#headlights.clear();
    this.placed = this.keepsPlaces ? [] : null;
    for (let i = 0; i < this.#objects.length; i += 1) {
      const row = i * OBJECT_WIDTH;
      const [x, y, yaw, vx, vy, yaw_rate] = shown.objects.subarray(row, row + OBJECT_WIDTH);
      const speed = vx * Math.cos(yaw) + vy * Math.sin(yaw);
      this.#place(this.#objects[i], { x, y, yaw, dt, heightAt, eye, own: false, speed,
        steering: steeringOf(this.#objects[i].wheelbase, speed, yaw_rate),
        brakes: this.#brakeLights.ofObject(i),
        lights: this.#store.signals.objects[this.#objects[i].id] ?? 0 });
    }
    for (let i = 0; i < this.#vehicles.length; i += 1) {
      const row = i * VEHICLE_WIDTH;
      const yaw = shown.vehicles[row + VEHICLE.yaw];
      const ahead = scene.vehicles[i].rear_to_center;
      this.#place(this.#vehicles[i], {
        x: shown.vehicles[row] + ahead * Math.cos(yaw),
        y: shown.vehicles[row + 1] + ahead * Math.sin(yaw), yaw, dt, heightAt, eye,
        own: this.#vehicles[i].id === own, steering: shown.vehicles[row + VEHICLE.steering_angle],
        speed: shown.vehicles[row + VEHICLE.speed],
        brakes: this.#brakeLights.ofVehicle(shown.vehicles, row),
        lights: shown.vehicles[row + VEHICLE.lights],
      });
    }
  }

  /** @param sight of the camera that draws next */
  see(sight: Sight) {
    for (const instances of this.#instances.values()) {
      instances.see(sight);
    }
    this.#parts.see(sight);
    this.#headlights.see(sight);
  }

  /** Return a driven vehicle's colour, which does not depend on its driver. */
  paintOf(id: string): number {
    return this.#vehicles.find((thing) => thing.id === id)?.look.paint ?? 0;
  }

  /** @param t simulation time that is shown [s] */
  #elapsed(t: number) {
    const dt = t - this.#shown_t;
    this.#shown_t = t;
    return Number.isFinite(dt) && Math.abs(dt) < 1 ? dt : 0;
  }

  #clear() {
    for (const instances of this.#instances.values()) {
      instances.dispose();
    }
    this.#instances.clear();
  }

  #thing(look: Appearance, body: Body, id: string, role: number): Thing {
    const along = (look.length ?? body.length) / body.length;
    return {
      id, look, body, role, rolled: 0, parked: false, kind: 'vehicle',
      bounds: null,
      instances: this.#instances.get(look.key) as Instances,
      scale: [along, (look.width ?? body.width) / body.width,
        (look.height ?? body.height) / body.height],
      wheelbase: body.wheels === null ? 0 : along * (body.wheels.front - body.wheels.rear),
    };
  }

  /** @param state of its middle, in the map's coordinates */
  #place(thing: Thing,
    { x, y, yaw, speed, steering, dt, brakes, lights, own, heightAt, eye }: { x: number; y: number;
    yaw: number; speed: number; steering: number; dt: number; brakes: boolean; lights: number;
    own: boolean; heightAt: HeightAt; eye: { x: number; y: number } }) {
    const px = x - this.#origin.x;
    const py = y - this.#origin.y;
    // An absent thing has no place.
    const distance = Math.hypot(px - eye.x, py - eye.y);
    if (!(distance < this.limits.farthest_m)) {
      return;
    }
    const { body, scale, look } = thing;
    thing.rolled += (speed || 0) * dt;
    const pose = poseOf(x, y, yaw, 0.35 * body.length * scale[0], heightAt);
    const matrix = this.#matrix.identity().makeRotationZ(yaw)
      .multiply(this.#parts.pitched(pose.slope)).setPosition(px, py, pose.z);
    this.#parts.addShadow(matrix, body.length * scale[0], body.width * scale[1], own);
    if (body.wheels !== null && distance < this.limits.wheels_m) {
      this.#parts.addWheels(matrix, body.wheels, scale, steering || 0, thing.rolled, own);
    }
    if (body.lamps !== null) {
      const shines = shining(lights, this.#shown_t);
      this.#parts.addLamps(matrix, body.lamps, scale, {
        ...shines, brakes: brakes || shines.brake }, own);
      if (shines.blue) {
        this.#parts.addBlueLights(matrix, body, scale, own);
      }
      if (this.#headlights.on && !thing.parked) {
        this.#headlights.add(matrix, body.lamps, scale, distance, own);
      }
    }
    this.#scaling.set(scale[0], scale[1], scale[2]);
    thing.instances.add(matrix.scale(this.#scaling), this.byRole ? thing.role : look.paint, own);
    if (this.placed !== null) {
      thing.bounds ??= body.mesh.bounds;
      const { low: [rear, right], high } = thing.bounds;
      // Wheels are no part of the mesh, and stand on the road.
      this.placed.push({ id: thing.id, kind: thing.kind, own, matrix: matrix.toArray(),
        low: [rear, right, 0], high });
    }
  }
}

/** Return what people call a thing. */
function kindOf(type: string, { wheels, lamps }: Body): PlacedBody['kind'] {
  return type === 'pedestrian' ? type : wheels === null && lamps === null ? 'object' : 'vehicle';
}

/**
 * Return the height of the road midway between two points along the heading, and the slope.
 * @param x [m]
 * @param y [m]
 * @param yaw [rad]
 * @param reach of the points from the middle [m]
 * @returns [m], [rad] upwards
 */
export function poseOf(x: number, y: number, yaw: number, reach: number,
  heightAt: HeightAt): { z: number; slope: number } {
  const dx = reach * Math.cos(yaw);
  const dy = reach * Math.sin(yaw);
  const front = heightAt(x + dx, y + dy);
  const rear = heightAt(x - dx, y - dy);
  return { z: 0.5 * (front + rear), slope: Math.atan2(front - rear, 2 * reach) };
}

// Largest steering angle of cars [rad].
const MOST = 0.65;
// Below this speed, the quotient is unreliable: the wheels straighten up to standstill [m/s].
const SLOW = 1;

/**
 * Return the steering angle of a single-track model with this motion:
 * tan(angle) = wheelbase * yaw rate / speed.
 * @param wheelbase [m]
 * @param speed along its heading, below 0 backwards [m/s]
 * @param yaw_rate [rad/s]
 * @returns [rad], positive to the left; 0 at standstill
 */
export function steeringOf(wheelbase: number, speed: number, yaw_rate: number): number {
  if (Math.abs(speed) < Number.EPSILON) {
    return 0;
  }
  const angle = Math.atan(wheelbase * yaw_rate / speed);
  return Math.min(Math.max(angle, -MOST), MOST) * Math.min(Math.abs(speed) / SLOW, 1) ** 2;
}
