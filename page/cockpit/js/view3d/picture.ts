// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** One canvas on which three.js draws: the renderer, the world, the bodies and the cameras. */

import { DEGREE, DEGREES } from '../units.js';
import { createCabin } from './cabin.js';
import { above, chasing, mountedAt, standOf } from './cameras.js';
import { eyeOf, mirrorOf, seenBy } from './contents.js';
import { localOrigin } from './local_origin.js';
import { Mirrors } from './mirrors.js';
import { PlanRibbons } from './plan_ribbons.js';
import { FrameCost, isSoftware, Quality } from './quality.js';
import { createRoadWorld } from './road/road_world.js';
import { sightOf } from './seen_instances.js';
import { product } from './solid_boxes.js';
import { Traffic } from './traffic.js';

import type { PerspectiveCamera } from 'three';
import type { Scene, SceneVehicle } from '../messages.js';
import type { Shown, Store } from '../store.js';
import type { CameraPose, Stand, Viewpoint } from './cameras.js';
import type { Contents, Sighting } from './contents.js';
import type { RoadWorld } from './road/road_world.js';
import type { Three } from './three.js';

const NEAR_M = 0.2;
const FAR_M = 3000;
// Range of a mirror, beyond which things are indistinct [m].
const FAR_IN_MIRROR_M = 300;
// It also has few pixels: things are plain from this share of the distance on.
const PLAIN_IN_MIRROR = 0.5;

/** The view to draw. */
export interface Looks {
  viewpoint: Viewpoint;
  index: number; // of the vehicle
  aside: number; // to the left of straight ahead [rad]
  height: number; // angle of the picture in height [rad]
  mirrors: boolean; // whether the driver has them
  plans: boolean; // whether the AVs' plans are shown
}

/** The picture of the state that a store shows. */
export class Picture {
  /** Figures of the last picture; `t` is the simulation time that it shows [s]. */
  stats = { frames: 0, t: NaN, draw_calls: 0, triangles: 0, frame_ms: 0, cost_ms: NaN, width: 0,
    height: 0, ratio: 1, renderer: '', software: false };
  mirrors;
  #three;
  #renderer;
  #scene;
  #camera;
  #traffic;
  #plans;
  #quality;
  #cost;
  #size = { width: 1, height: 1 };
  #road: RoadWorld | null = null;
  #document: Scene | null = null;
  #cabin: { mesh: ReturnType<typeof createCabin>; vehicle: SceneVehicle } | null = null;
  #origin = { x: 0, y: 0 };
  #last: { stand: Stand; mirrors: boolean; inside: boolean } | null = null;
  store;

  /** @throws {Error} if the browser has no WebGL 2 */
  constructor(three: Three, canvas: HTMLCanvasElement, store: Store) {
    this.#three = three;
    const name = rendererName();
    const software = isSoftware(name);
    Object.assign(this.stats, { renderer: name, software });
    this.#renderer = new three.WebGLRenderer({ canvas, antialias: !software });
    this.#renderer.info.autoReset = false;
    this.#quality = new Quality(software, window.devicePixelRatio);
    this.#cost = new FrameCost(this.#renderer.getContext());
    this.#scene = new three.Scene();
    this.#camera = new three.PerspectiveCamera(60, 1, NEAR_M, FAR_M);
    this.#camera.rotation.order = 'ZXY';
    const bodies = new three.Group();
    this.#scene.add(bodies);
    this.#traffic = new Traffic(three, bodies, store);
    this.#plans = new PlanRibbons(three, bodies, store);
    this.mirrors = new Mirrors(three, software);
    store.on('scene', (scene) => this.#load(scene));
    if (store.scene !== null) {
      this.#load(store.scene);
    }
    this.store = store;
  }

  /** Return the least time from picture to picture [ms]. */
  get period_ms() {
    return this.#quality.period_ms;
  }

  /** @param sharp whether all pixels of the screen are drawn, at any cost */
  set sharp(sharp: boolean) {
    if (sharp !== this.#quality.sharp) {
      this.#quality.sharp = sharp;
      this.#choose();
      this.resize(this.#size.width, this.#size.height);
    }
  }

  /** Return whether the graphics context is lost. */
  get lost() {
    return this.#renderer.getContext().isContextLost();
  }

  /** Return the main camera, as of the last picture. */
  get camera() {
    return this.#camera;
  }

  /** Return the origin of the cameras' coordinates in the map. */
  get origin() {
    return this.#origin;
  }

  /** `width` [CSS px]; `height` [CSS px]. */
  resize(width: number, height: number) {
    this.#size = { width, height };
    const { ratio } = this.#quality;
    this.#renderer.setPixelRatio(ratio);
    this.#renderer.setSize(width, height, false);
    this.mirrors.resize(width, height, ratio);
    Object.assign(this.stats, { width, height, ratio });
  }

  /**
   * Draw one picture.
   * @param shown current rows
   * @param now_ms the animation frame's time
   * @returns false while nothing can be seen
   */
  draw(shown: Shown, now_ms: number, looks: Looks): boolean {
    const vehicle = this.#document?.vehicles[looks.index];
    const road = this.#road;
    if (vehicle === undefined || road === null || this.lost) {
      return false;
    }
    const stand = standOf(shown, looks.index, vehicle, road.heightAt);
    if (stand === null) {
      return false;
    }
    const begin_ms = performance.now();
    const inside = looks.viewpoint === 'driver';
    this.#renderer.info.reset();
    this.#aimMain(stand, vehicle, looks);
    const eye = this.#camera.position;
    road.update(this.store, { x: eye.x, y: eye.y, z: eye.z });
    this.#traffic.byRole = !inside;
    this.#traffic.update(shown, vehicle.id, road.heightAt, eye);
    this.#plans.update(looks.plans, shown, this.#origin, road.heightAt);
    const measures = this.#cost.begin();
    if (inside && looks.mirrors && (this.mirrors.count < this.mirrors.all.length
        || this.stats.frames % this.#quality.detail.mirrorEvery === 0)) {
      this.#drawMirror(stand, vehicle);
    }
    this.#drawMain(stand, vehicle, inside);
    if (inside && looks.mirrors) {
      this.mirrors.drawOver(this.#renderer);
    }
    this.#last = { stand, inside, mirrors: inside && looks.mirrors };
    this.#note(shown.t, begin_ms, now_ms, measures);
    return true;
  }

  /** Return whether `contents` is known, once a picture has been drawn. */
  get keepsPlaces() {
    return this.#traffic.keepsPlaces;
  }

  set keepsPlaces(kept: boolean) {
    this.#traffic.keepsPlaces = kept;
  }

  /** Return what was where in the last picture; null if that is not known. */
  contents(): Contents | null {
    const { placed } = this.#traffic;
    if (placed === null || this.#last === null || this.#road === null || this.lost) {
      return null;
    }
    const { stand, inside, mirrors } = this.#last;
    const others = placed.filter(({ own }) => !own);
    const things = [...inside ? others : placed, ...this.#road.solids];
    // Mirrors are drawn in turn, and look old by a picture or two; here they are as new as all
    // else.
    const glasses = mirrors ? this.mirrors.all.flatMap(({ name, camera, rectangle, optics }) => {
      if (optics === null) {
        return [];
      }
      this.#aim(camera, mountedAt(stand, optics.point, optics.aside, optics.pitch));
      return mirrorOf({ name, rectangle, ...this.#sighting(camera) }, others, this.#size);
    }) : [];
    const { position: { x, y, z }, fov, aspect } = this.#camera;
    const forwards = this.#camera.getWorldDirection(new this.#three.Vector3());
    return {
      eye: eyeOf(stand, [x + this.#origin.x, y + this.#origin.y, z],
        [forwards.x, forwards.y, forwards.z], fov * DEGREE, aspect),
      shown: [...glasses, ...seenBy(this.#sighting(this.#camera), things)],
    };
  }

  #sighting({ projectionMatrix, matrixWorldInverse, position }: PerspectiveCamera): Sighting {
    return { view: product(projectionMatrix.elements, matrixWorldInverse.elements),
      eye: [position.x, position.y, position.z] };
  }

  #aimMain(stand: Stand, vehicle: SceneVehicle, { viewpoint, aside, height }: Looks) {
    const [x, y, z] = vehicle.driver_place.eye;
    const rear = vehicle.rear_to_center - 0.5 * vehicle.shape.length;
    const pose = viewpoint === 'driver' ? mountedAt(stand, { x, y, z }, aside)
      : viewpoint === 'chase' ? chasing(stand, rear, aside)
        : above(stand);
    this.#camera.fov = height * DEGREES;
    this.#camera.aspect = this.#size.width / this.#size.height;
    this.#camera.updateProjectionMatrix();
    this.#aim(this.#camera, pose);
  }

  #aim(camera: PerspectiveCamera, { x, y, z, yaw, slope, aside, pitch }: CameraPose) {
    camera.position.set(x - this.#origin.x, y - this.#origin.y, z);
    const { Euler, Quaternion } = this.#three;
    // At rest a camera looks down, with its upper edge to the north. It is pitched, then turned in
    // the vehicle, which is turned itself.
    camera.quaternion.setFromEuler(new Euler(0, -slope, yaw, 'ZYX')).multiply(
      new Quaternion().setFromEuler(
        new Euler(Math.PI / 2 + pitch, 0, aside - Math.PI / 2, 'ZXY')));
    camera.updateMatrixWorld();
  }

  #drawMirror(stand: Stand, vehicle: SceneVehicle) {
    if (this.#cabin !== null) {
      this.#cabin.mesh.visible = false;
    }
    this.mirrors.fit(vehicle.driver_place, FAR_IN_MIRROR_M);
    this.mirrors.drawNext(this.#renderer, this.#scene, (camera, { point, aside, pitch }) => {
      this.#aim(camera, mountedAt(stand, point, aside, pitch));
      this.#see(camera, PLAIN_IN_MIRROR, true);
    });
  }

  /**
   * Submit the things that a camera sees.
   * @param sooner share of the distance at which things are plain
   * @param own whether the own vehicle is drawn
   */
  #see(camera: PerspectiveCamera, sooner: number, own: boolean) {
    const sight = sightOf(this.#three, camera, sooner * this.#quality.detail.plain_m, own);
    this.#road?.see(sight);
    this.#traffic.see(sight);
  }

  /** Apply the chosen detail. */
  #choose() {
    const { farthest_m, wheels_m, fine } = this.#quality.detail;
    this.#traffic.limits = { farthest_m, wheels_m };
    this.#road?.setFine(fine);
  }

  #drawMain(stand: Stand, vehicle: SceneVehicle, inside: boolean) {
    if (inside && this.#cabin?.vehicle !== vehicle) {
      this.#cabin?.mesh.removeFromParent();
      this.#cabin?.mesh.geometry.dispose();
      this.#cabin?.mesh.material.dispose();
      const mesh = createCabin(this.#three, vehicle, this.#traffic.paintOf(vehicle.id));
      this.#scene.add(mesh);
      this.#cabin = { mesh, vehicle };
    }
    if (this.#cabin !== null) {
      const { mesh } = this.#cabin;
      mesh.visible = inside && vehicle.driver_place.inner_mirror !== null;
      mesh.position.set(stand.x - this.#origin.x, stand.y - this.#origin.y, stand.z);
      mesh.rotation.set(0, -stand.slope, stand.yaw, 'ZYX');
    }
    this.#see(this.#camera, 1, !inside);
    this.#renderer.render(this.#scene, this.#camera);
  }

  #note(t: number, begin_ms: number, now_ms: number, measures: boolean) {
    const { calls, triangles } = this.#renderer.info.render;
    Object.assign(this.stats, { frames: this.stats.frames + 1, t, draw_calls: calls, triangles,
      frame_ms: performance.now() - begin_ms });
    if (measures) {
      this.stats.cost_ms = this.#cost.end();
      if (this.#quality.adjust(this.stats.cost_ms, now_ms)) {
        this.#choose();
        this.resize(this.#size.width, this.#size.height);
      }
    }
  }

  #load(scene: Scene) {
    // A reset sends the same scene again, so its roads stay.
    if (this.#road === null || this.#document?.id !== scene.id) {
      this.#road?.group.removeFromParent();
      this.#road?.dispose();
      this.#origin = localOrigin(scene);
      this.#road = createRoadWorld(this.#three, scene);
      this.#scene.add(this.#road.group);
      this.#scene.fog = this.#road.fog;
    } else {
      this.#road.setEnvironment(scene.environment);
    }
    this.#document = scene;
    this.#choose();
    this.#traffic.load(scene, this.#origin);
  }
}

/** Return the name of the renderer, if the browser reveals it. */
function rendererName() {
  const context = document.createElement('canvas').getContext('webgl2');
  if (context === null) {
    throw new Error('this browser has no WebGL 2');
  }
  const details = context.getExtension('WEBGL_debug_renderer_info');
  const name = context.getParameter(details?.UNMASKED_RENDERER_WEBGL ?? context.RENDERER);
  context.getExtension('WEBGL_lose_context')?.loseContext();
  return String(name);
}
