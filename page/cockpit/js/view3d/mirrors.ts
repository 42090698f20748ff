// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The three mirrors: their optics, and each in its own picture, drawn in turn over the view. */

import { DEGREE, DEGREES } from '../units.js';

import type { PerspectiveCamera, Scene as Scene3, WebGLRenderer } from 'three';
import type { DriverPlace } from '../messages.js';
import type { Point } from './cameras.js';
import type { Three } from './three.js';

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

// [CSS px]
export interface Rectangle { left: number; bottom: number; width: number; height: number }

/** Mirrors of the driver's vehicle. */
export class Mirrors {
  #overlay;
  #flat;
  #glasses: ReturnType<typeof makeGlass>[];
  #next = 0;
  /** Number of mirror pictures so far. */
  count = 0;
  /** Name of the one that was drawn last; empty before. */
  drawn = '';
  #width = 1;
  #height = 1;

  /** @param software whether the processor draws */
  constructor(three: Three, software: boolean) {
    this.#overlay = new three.Scene();
    this.#flat = new three.OrthographicCamera(0, 1, 1, 0, -1, 1);
    this.#glasses = MIRRORS.map((mirror) => makeGlass(three, this.#overlay, mirror, software));
  }

  /**
   * Fit the mirrors into a picture.
   * @param width [CSS px]
   * @param height [CSS px]
   * @param ratio of pixels to CSS pixels
   */
  resize(width: number, height: number, ratio: number) {
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

  /** `place` of the vehicle; `far` [m]. */
  fit(place: DriverPlace, far: number) {
    for (const glass of this.#glasses) {
      glass.optics = mirrorCamera(glass.mirror, place);
      glass.pane.visible = glass.frame.visible = glass.optics !== null;
      if (glass.optics === null) {
        continue;
      }
      Object.assign(glass.camera, {
        fov: glass.optics.height * DEGREES, aspect: glass.optics.aspect,
        near: glass.optics.near, far });
      glass.camera.updateProjectionMatrix();
    }
  }

  /** Draw the next mirror; `aim` puts a camera where the vehicle is. */
  drawNext(renderer: WebGLRenderer, scene: Scene3,
    aim: (camera: PerspectiveCamera, optics: MirrorCamera) => void) {
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

  /** @param renderer has drawn the view */
  drawOver(renderer: WebGLRenderer) {
    renderer.autoClear = false;
    renderer.clearDepth();
    renderer.render(this.#overlay, this.#flat);
    renderer.autoClear = true;
  }

  /** Return each mirror's camera and place on the screen; the vehicle may lack it. */
  get all(): { name: string; camera: PerspectiveCamera; rectangle: Rectangle;
    optics: MirrorCamera | null }[] {
    return this.#glasses.map(({ mirror, camera, optics }) => (
      { name: mirror.name, camera, rectangle: this.#rectangle(mirror), optics }));
  }

  #rectangle({ name, width, height }: Mirror): Rectangle {
    const { x, y, width: share } = PLACES[name];
    const w = share * this.#width;
    const h = (w * height) / width;
    return { left: x * this.#width - w / 2, bottom: y * this.#height - h / 2, width: w,
      height: h };
  }
}

/** @param overlay gets the glass and its frame */
function makeGlass(three: Three, overlay: Scene3, mirror: Mirror, software: boolean) {
  const target = new three.WebGLRenderTarget(16, 8, { samples: software ? 0 : 4 });
  const camera = new three.PerspectiveCamera();
  const pane = new three.Mesh(turnedOver(three),
    new three.MeshBasicMaterial({ map: target.texture, depthTest: false, toneMapped: false }));
  pane.renderOrder = 1;
  const frame = new three.Mesh(new three.PlaneGeometry(1, 1),
    new three.MeshBasicMaterial({ color: FRAME, depthTest: false, toneMapped: false }));
  overlay.add(frame, pane);
  return { mirror, target, camera, pane, frame,
    size: [16, 8] as [number, number],
    optics: null as MirrorCamera | null };
}

function turnedOver(three: Three) {
  const plane = new three.PlaneGeometry(1, 1);
  const uv = plane.getAttribute('uv');
  for (let i = 0; i < uv.count; i += 1) {
    uv.setX(i, 1 - uv.getX(i));
  }
  return plane;
}

/** A mirror of a vehicle, convex like the side mirrors of cars. */
interface Mirror {
  name: 'left' | 'right' | 'inner';
  mount: 'left_mirror' | 'right_mirror' | 'inner_mirror'; // its place in the scene document
  width: number; // of its glass [m]
  height: number; // [m]
  radius: number; // of the sphere that it is part of; infinite for a flat one [m]
  aside: number; // direction of its middle, to the left of straight back [rad]
  pitch: number; // above the horizon [rad]
}

/** UN R46: at least 1.2 m for the outer mirrors of cars. */
export const MIRRORS: readonly Mirror[] = Object.freeze([
  { name: 'left', mount: 'left_mirror', width: 0.19, height: 0.13, radius: 1.4,
    aside: -11 * DEGREE, pitch: -3 * DEGREE },
  { name: 'inner', mount: 'inner_mirror', width: 0.24, height: 0.065, radius: Infinity,
    aside: 0, pitch: -2 * DEGREE },
  { name: 'right', mount: 'right_mirror', width: 0.19, height: 0.13, radius: 1.4,
    aside: 9 * DEGREE, pitch: -3 * DEGREE },
]);

/** The camera of a mirror. Its picture is mirrored, left to right. */
interface MirrorCamera {
  point: Point; // ahead of the rear axle, to the left, above the road [m]
  aside: number; // to the left of straight ahead [rad]
  pitch: number; // above the horizon [rad]
  height: number; // angle of the picture in height [rad]
  aspect: number; // width of the picture through its height
  near: number; // plane, at the glass [m]
}

/**
 * Return the camera of a mirror.
 *
 * The glass stands across the line on which the driver sees its middle. The eye at distance d has
 * its image behind the glass at 1/d' = 1/d + 2/R (the mirror equation for a far eye, f = -R/2).
 * @param place eyes and mirrors of the vehicle
 * @returns null without this mirror
 */
export function mirrorCamera(mirror: Mirror, place: DriverPlace): MirrorCamera | null {
  const glass = place[mirror.mount];
  if (glass === null) {
    return null;
  }
  const distance = Math.hypot(...glass.map((value, axis) => value - place.eye[axis]));
  const behind = 1 / (1 / distance + 2 / mirror.radius);
  const aside = Math.PI + mirror.aside;
  const along = Math.cos(mirror.pitch);
  return {
    point: {
      x: glass[0] - behind * along * Math.cos(aside),
      y: glass[1] - behind * along * Math.sin(aside),
      z: glass[2] - behind * Math.sin(mirror.pitch),
    },
    aside, pitch: mirror.pitch, near: behind,
    height: 2 * Math.atan((0.5 * mirror.height) / behind), aspect: mirror.width / mirror.height,
  };
}
