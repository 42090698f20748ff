// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The three mirrors: each is drawn into its own picture, in turn, and laid over the view. */

import { mirrorCamera, MIRRORS } from './mirror_optics.js';

/** @import { PerspectiveCamera, Scene as Scene3, WebGLRenderer } from 'three' */
/** @import { DriverPlace } from '../messages.js' */
/** @import { Mirror, MirrorCamera } from './mirror_optics.js' */
/** @import { Three } from './road/road_world.js' */

// Places on the screen: middle and width as shares of its width and height, from below.
const PLACES = {
  left: { x: 0.105, y: 0.47, width: 0.19 },
  inner: { x: 0.62, y: 0.915, width: 0.25 },
  right: { x: 0.895, y: 0.47, width: 0.19 },
};
// Mirrors are drawn coarser than the view.
const COARSER = 0.75;
const FRAME_PX = 4;
const FRAME = 0x14161a;

/**
 * @typedef {{left: number, bottom: number, width: number, height: number}} Rectangle [CSS px]
 */

/** Mirrors of the driver's vehicle. */
export class Mirrors {
  #overlay;
  #flat;
  /** @type {ReturnType<typeof makeGlass>[]} */
  #glasses;
  #next = 0;
  /** Number of mirror pictures so far. */
  count = 0;
  /** Name of the one that was drawn last; empty before. */
  drawn = '';
  #width = 1;
  #height = 1;

  /**
   * @param {Three} three
   * @param {boolean} software whether the processor draws
   */
  constructor(three, software) {
    this.#overlay = new three.Scene();
    this.#flat = new three.OrthographicCamera(0, 1, 1, 0, -1, 1);
    this.#glasses = MIRRORS.map((mirror) => makeGlass(three, this.#overlay, mirror, software));
  }

  /**
   * Fit the mirrors into a picture.
   *
   * @param {number} width [CSS px]
   * @param {number} height [CSS px]
   * @param {number} ratio of pixels to CSS pixels
   */
  resize(width, height, ratio) {
    this.#width = width;
    this.#height = height;
    this.#flat.right = width;
    this.#flat.top = height;
    this.#flat.updateProjectionMatrix();
    for (const glass of this.#glasses) {
      const { mirror, pane, frame } = glass;
      const { left, bottom, width: w, height: h } = this.#rectangle(mirror);
      glass.size = [Math.max(Math.round(w * ratio * COARSER), 16),
        Math.max(Math.round(h * ratio * COARSER), 8)];
      pane.position.set(left + w / 2, bottom + h / 2, 0.5);
      pane.scale.set(w, h, 1);
      frame.position.set(left + w / 2, bottom + h / 2, 0);
      frame.scale.set(w + 2 * FRAME_PX, h + 2 * FRAME_PX, 1);
    }
  }

  /**
   * @param {DriverPlace} place of the vehicle
   * @param {number} far [m]
   */
  fit(place, far) {
    for (const glass of this.#glasses) {
      glass.optics = mirrorCamera(glass.mirror, place);
      glass.pane.visible = glass.frame.visible = glass.optics !== null;
      if (glass.optics === null) {
        continue;
      }
      Object.assign(glass.camera, {
        fov: glass.optics.height * 180 / Math.PI, aspect: glass.optics.aspect,
        near: glass.optics.near, far });
      glass.camera.updateProjectionMatrix();
    }
  }

  /**
   * Draw the next mirror.
   *
   * @param {WebGLRenderer} renderer
   * @param {Scene3} scene
   * @param {(camera: PerspectiveCamera, optics: MirrorCamera) => void} aim puts a camera where
   *   the vehicle is
   */
  drawNext(renderer, scene, aim) {
    const { mirror, target, camera, optics, size } = this.#glasses[this.#next];
    this.drawn = mirror.name;
    this.count += 1;
    this.#next = (this.#next + 1) % this.#glasses.length;
    if (optics !== null) {
      aim(camera, optics);
      // Only now, because a resized target is empty.
      target.setSize(...size);
      renderer.setRenderTarget(target);
      renderer.render(scene, camera);
      renderer.setRenderTarget(null);
    }
  }

  /** @param {WebGLRenderer} renderer has drawn the view */
  drawOver(renderer) {
    renderer.autoClear = false;
    renderer.clearDepth();
    renderer.render(this.#overlay, this.#flat);
    renderer.autoClear = true;
  }

  /**
   * Return each mirror's camera and place on the screen.
   *
   * @returns {{name: string, camera: PerspectiveCamera, rectangle: Rectangle}[]}
   */
  get all() {
    return this.#glasses.map(({ mirror, camera }) => (
      { name: mirror.name, camera, rectangle: this.#rectangle(mirror) }));
  }

  /**
   * @param {Mirror} mirror
   * @returns {Rectangle}
   */
  #rectangle({ name, width, height }) {
    const { x, y, width: share } = PLACES[name];
    const w = share * this.#width;
    const h = (w * height) / width;
    return { left: x * this.#width - w / 2, bottom: y * this.#height - h / 2, width: w,
      height: h };
  }
}

/**
 * @param {Three} three
 * @param {Scene3} overlay gets the glass and its frame
 * @param {Mirror} mirror
 * @param {boolean} software
 */
function makeGlass(three, overlay, mirror, software) {
  const target = new three.WebGLRenderTarget(16, 8, { samples: software ? 0 : 4 });
  const camera = new three.PerspectiveCamera();
  const pane = new three.Mesh(turnedOver(three),
    new three.MeshBasicMaterial({ map: target.texture, depthTest: false, toneMapped: false }));
  pane.renderOrder = 1;
  const frame = new three.Mesh(new three.PlaneGeometry(1, 1),
    new three.MeshBasicMaterial({ color: FRAME, depthTest: false, toneMapped: false }));
  overlay.add(frame, pane);
  return { mirror, target, camera, pane, frame,
    size: /** @type {[number, number]} */ ([16, 8]),
    optics: /** @type {MirrorCamera|null} */ (null) };
}

/** @param {Three} three */
function turnedOver(three) {
  const plane = new three.PlaneGeometry(1, 1);
  const uv = plane.getAttribute('uv');
  for (let i = 0; i < uv.count; i += 1) {
    uv.setX(i, 1 - uv.getX(i));
  }
  return plane;
}
