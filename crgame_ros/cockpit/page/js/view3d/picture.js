// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** One canvas on which three.js draws: the renderer, its scene and the camera. */

import { localOrigin } from './local_origin.js';
import { createRoadWorld } from './road/road_world.js';

/** @import { Scene } from '../messages.js' */
/** @import { Store } from '../store.js' */
/** @import { CameraPose } from './cameras.js' */
/** @import { RoadWorld, Three } from './road/road_world.js' */

const NEAR_M = 0.1;
const FAR_M = 3000;
const SKY = 0xbcd3e6;

/** Draws what a store shows. */
export class Picture {
  stats = { frames: 0, draw_calls: 0, triangles: 0, frame_ms: 0 };
  #three;
  #store;
  #renderer;
  #scene;
  #camera;
  /** @type {RoadWorld|null} */
  #road = null;
  #origin = { x: 0, y: 0 };

  /**
   * @param {Three} three the library
   * @param {HTMLCanvasElement} canvas
   * @param {Store} store
   * @throws {Error} if the browser has no WebGL 2
   */
  constructor(three, canvas, store) {
    this.#three = three;
    this.#store = store;
    this.#renderer = new three.WebGLRenderer({ canvas, antialias: true });
    this.#scene = new three.Scene();
    this.#scene.background = new three.Color(SKY);
    this.#camera = new three.PerspectiveCamera(60, 1, NEAR_M, FAR_M);
    this.#camera.up.set(0, 0, 1);
    this.#camera.rotation.order = 'ZXY';
    const sun = new three.DirectionalLight(0xffffff, 2);
    sun.position.set(-0.4, -0.6, 1);
    this.#scene.add(sun, new three.HemisphereLight(0xdfeaf5, 0x6f8a5a, 1.4));
    store.on('scene', (scene) => this.#load(scene));
    if (store.scene !== null) {
      this.#load(store.scene);
    }
  }

  /**
   * @param {number} width [CSS px]
   * @param {number} height [CSS px]
   */
  resize(width, height) {
    this.#renderer.setPixelRatio(window.devicePixelRatio);
    this.#renderer.setSize(width, height, false);
    this.#camera.aspect = width / height;
    this.#camera.updateProjectionMatrix();
  }

  /**
   * Draw one picture.
   *
   * @param {number} now_ms the animation frame's time
   * @param {CameraPose} pose of the camera, in the map's coordinates
   */
  draw(now_ms, { x, y, z, yaw, pitch }) {
    const begin_ms = performance.now();
    const eye = { x: x - this.#origin.x, y: y - this.#origin.y, z };
    this.#camera.position.set(eye.x, eye.y, eye.z);
    // In 'ZXY' a camera, which looks down at rest, is first pitched and then turned.
    this.#camera.rotation.set(Math.PI / 2 + pitch, 0, yaw - Math.PI / 2);
    this.#road?.update(this.#store, now_ms, eye);
    this.#renderer.render(this.#scene, this.#camera);
    const { calls, triangles } = this.#renderer.info.render;
    Object.assign(this.stats, { frames: this.stats.frames + 1, draw_calls: calls, triangles,
      frame_ms: performance.now() - begin_ms });
  }

  /**
   * The height of the road at a point of the map.
   *
   * @param {number} x
   * @param {number} y
   */
  heightAt(x, y) {
    return this.#road?.heightAt(x, y) ?? 0;
  }

  /** @param {Scene} scene */
  #load(scene) {
    if (this.#road !== null) {
      this.#scene.remove(this.#road.group);
      this.#road.dispose();
    }
    this.#origin = localOrigin(scene);
    this.#road = createRoadWorld(this.#three, scene);
    this.#scene.add(this.#road.group);
  }
}
