// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** All vehicles and objects as bodies, at their current poses. */

import { OBJECT_WIDTH, VEHICLE, VEHICLE_WIDTH } from '../frames.js';
import { shining } from '../lights.js';
import { BrakeLights } from '../world/brake_lights.js';
import { ofObject, ofVehicle } from './bodies/appearance.js';
import { plainBody } from './bodies/plain_bodies.js';
import { FittedParts } from './fitted_parts.js';
import { Headlights } from './headlights.js';
import { Instances } from './instances.js';
import { steeringOf } from './steering.js';

/** @import { Group } from 'three' */
/** @import { Scene } from '../messages.js' */
/** @import { Shown, Store } from '../store.js' */
/** @import { Appearance } from './bodies/appearance.js' */
/** @import { Body } from './bodies/motor_vehicles.js' */
/** @import { Origin } from './local_origin.js' */
/** @import { Three } from './road/road_world.js' */
/** @import { Sight } from './seen_instances.js' */

/**
 * @typedef {object} Thing
 * @property {string} id
 * @property {Appearance} look
 * @property {Body} body
 * @property {Instances} instances
 * @property {[x: number, y: number, z: number]} scale of the body
 * @property {number} role its colour on the map
 * @property {number} rolled distance of its wheels [m]
 * @property {number} wheelbase of the body as it is scaled; 0 without wheels [m]
 * @property {boolean} parked whether it is parked, without a driver
 */

/** @typedef {(x: number, y: number) => number} HeightAt of the road at a point of the map [m] */

/** The bodies of one scene. */
export class Traffic {
  /** Whether bodies have the map's colours, which show what drives them. */
  byRole = false;
  #three;
  /** Distances beyond which no body is drawn, and no wheel turns [m]. */
  limits = { farthest_m: 0, wheels_m: 0 };
  #group;
  /** @type {Thing[]} */
  #vehicles = [];
  /** @type {Thing[]} */
  #objects = [];
  /** @type {Map<string, Instances>} */
  #instances = new Map();
  #parts;
  #headlights;
  #brakeLights = new BrakeLights();
  #matrix;
  #scaling;
  /** @type {Origin} */
  #origin = { x: 0, y: 0 };
  /** @type {Scene|null} */
  #scene = null;
  #shown_t = NaN;
  #store;

  /**
   * @param {Three} three
   * @param {Group} group gets everything
   * @param {Store} store whose scenario steps and signals show which objects brake or indicate
   */
  constructor(three, group, store) {
    this.#three = three;
    this.#group = group;
    this.#matrix = new three.Matrix4();
    this.#scaling = new three.Vector3();
    this.#parts = new FittedParts(three, group);
    this.#headlights = new Headlights(three, group);
    this.#store = store;
    store.on('objects', (step) => this.#brakeLights.update(step));
  }

  /**
   * @param {Scene} scene
   * @param {Origin} origin of the coordinates in the group
   * @param {(role: string, type: string) => number} colorOf returns its colour on the map
   */
  load(scene, origin, colorOf) {
    this.#clear();
    this.#scene = scene;
    this.#origin = origin;
    this.#brakeLights.load(scene.objects.length);
    /** @type {Map<string, {look: Appearance, count: number}>} */
    const kinds = new Map();
    const looks = [...scene.vehicles.map(ofVehicle), ...scene.objects.map(ofObject)];
    for (const look of looks) {
      kinds.set(look.key, { look, count: (kinds.get(look.key)?.count ?? 0) + 1 });
    }
    /** @type {Map<string, Body>} */
    const bodies = new Map();
    for (const [key, { look, count }] of kinds) {
      const body = look.build();
      bodies.set(key, body);
      this.#instances.set(key, new Instances(this.#three, this.#group, body.mesh, count,
        plainBody(look.key, body)));
    }
    const things = looks.map((look, i) => {
      const vehicle = scene.vehicles[i];
      const object = scene.objects[i - scene.vehicles.length];
      return this.#thing(look, /** @type {Body} */ (bodies.get(look.key)),
        vehicle?.id ?? object.id, vehicle ? colorOf(vehicle.role, vehicle.type)
          : colorOf(object.role, object.type));
    });
    this.#vehicles = things.slice(0, scene.vehicles.length);
    this.#objects = things.slice(scene.vehicles.length);
    things.forEach((thing, i) => {
      thing.parked = scene.objects[i - scene.vehicles.length]?.role === 'static';
    });
    this.#parts.load(things.length);
    this.#headlights.load(scene.environment, things.length);
  }

  /**
   * Place all bodies at their current poses.
   *
   * @param {Shown} shown
   * @param {string|null} own id of the vehicle in which the camera may be
   * @param {HeightAt} heightAt
   * @param {{x: number, y: number}} eye of the camera, in the group's coordinates
   */
  update(shown, own, heightAt, eye) {
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

  /** @param {Sight} sight of the camera that draws next */
  see(sight) {
    for (const instances of this.#instances.values()) {
      instances.see(sight);
    }
    this.#parts.see(sight);
    this.#headlights.see(sight);
  }

  /**
   * @param {string} id of a driven vehicle
   * @returns {number} its colour, which does not depend on its driver
   */
  paintOf(id) {
    return this.#vehicles.find((thing) => thing.id === id)?.look.paint ?? 0;
  }

  /** @param {number} t simulation time that is shown [s] */
  #elapsed(t) {
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

  /**
   * @param {Appearance} look
   * @param {Body} body
   * @param {string} id
   * @param {number} role
   * @returns {Thing}
   */
  #thing(look, body, id, role) {
    const along = (look.length ?? body.length) / body.length;
    return {
      id, look, body, role, rolled: 0, parked: false,
      instances: /** @type {Instances} */ (this.#instances.get(look.key)),
      scale: [along, (look.width ?? body.width) / body.width,
        (look.height ?? body.height) / body.height],
      wheelbase: body.wheels === null ? 0 : along * (body.wheels.front - body.wheels.rear),
    };
  }

  /**
   * @param {Thing} thing
   * @param {{x: number, y: number, yaw: number, speed: number, steering: number, dt: number,
   *   brakes: boolean, lights: number, own: boolean, heightAt: HeightAt,
   *   eye: {x: number, y: number}}} state of its middle, in the map's coordinates
   */
  #place(thing, { x, y, yaw, speed, steering, dt, brakes, lights, own, heightAt, eye }) {
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
  }
}

/**
 * Return the height of the road midway between two points along the heading, and the slope.
 *
 * @param {number} x [m]
 * @param {number} y [m]
 * @param {number} yaw [rad]
 * @param {number} reach of the points from the middle [m]
 * @param {HeightAt} heightAt
 * @returns {{z: number, slope: number}} [m], [rad] upwards
 */
export function poseOf(x, y, yaw, reach, heightAt) {
  const dx = reach * Math.cos(yaw);
  const dy = reach * Math.sin(yaw);
  const front = heightAt(x + dx, y + dy);
  const rear = heightAt(x - dx, y - dy);
  return { z: 0.5 * (front + rear), slope: Math.atan2(front - rear, 2 * reach) };
}
