// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The camera of the map: a point, a scale, and the direction that is up. */

import { turn } from '../interpolation.js';

import type { Box, Pose } from '../messages.js';

const NORTH = Math.PI / 2;
const MIN_SCALE = 0.02;
const MAX_SCALE = 120;
const FIT_SHARE = 0.92;
// Time constant of camera moves that are not drags [ms].
const SETTLE_MS = 90;
// With heading up, a followed vehicle is this far down the free area, with the road ahead of it.
const FOLLOW_DOWN = 0.8;
const MIDDLE = 0.5;
// Road length on the free height for a followed vehicle [m], and additional time of travel [s].
const FOLLOW_HEIGHT = 70;
const FOLLOW_TIME = 2.8;

export interface Aim { x: number; y: number; scale: number; up: number; down: number }

/** Map frame (m, y up) <-> canvas (CSS pixels, y down). */
export class Camera {
  /** Size of the canvas, and how much of it something covers from below [CSS px]. */
  width = 1;
  height = 1;
  covered = 0;
  /** The current view: the point at the anchor [m], scale [px/m], map angle that is up [rad]. */
  x = 0;
  y = 0;
  scale = 4;
  up = NORTH;
  /** Whether a vehicle's heading is kept up. */
  headingUp = false;
  /** Columns of the map-to-canvas matrix as setTransform takes them, in CSS pixels. */
  a = 1;
  b = 0;
  c = 0;
  d = -1;
  /** The visible area, as an axis-parallel box in the map [m]. */
  left = 0;
  bottom = 0;
  right = 0;
  top = 0;

  #aim: Aim = { x: 0, y: 0, scale: 4, up: NORTH, down: MIDDLE };
  #slack = { x: 0, y: 0, scale: 0, up: 0, down: 0 };
  #updated_ms = NaN;
  #still = window.matchMedia('(prefers-reduced-motion: reduce)');

  /** Return the camera's point on the canvas [px]. */
  get anchorX() {
    return MIDDLE * this.width;
  }

  get anchorY() {
    return this.#down * this.#free;
  }

  /** Return whether it is still moving. */
  get moves() {
    return Object.values(this.#slack).some((value) => value !== 0);
  }

  /**
   * Set the canvas's size, and how much of it is covered from below [CSS px]. The map stays where
   * it is on the canvas; a followed vehicle moves to its new place.
   */
  resize(width: number, height: number, covered = 0) {
    const [x, y] = this.toMap(this.width / 2, 0);
    this.covered = covered;
    this.width = Math.max(width, 1);
    this.height = Math.max(height, 1);
    const [nowX, nowY] = this.toMap(this.width / 2, 0);
    this.#aim.x += x - nowX;
    this.#aim.y += y - nowY;
    this.#apply();
  }

  /** Move on towards the target; `now_ms`: the animation frame's time. */
  update(now_ms: number) {
    const elapsed_ms = Math.max(now_ms - (this.#updated_ms || now_ms), 0);
    this.#updated_ms = now_ms;
    const left = Math.exp(-elapsed_ms / SETTLE_MS);
    const slack = this.#slack;
    slack.x = shrink(slack.x * left, 0.2 / this.scale);
    slack.y = shrink(slack.y * left, 0.2 / this.scale);
    slack.scale = shrink(slack.scale * left, 1e-3);
    slack.up = shrink(slack.up * left, 5e-4);
    slack.down = shrink(slack.down * left, 5e-4);
    this.#apply();
  }

  /** Show a box [xmin, ymin, xmax, ymax] of the map entirely; north up. */
  fit(bounds: Box, animated = true) {
    const [xmin, ymin, xmax, ymax] = bounds;
    this.headingUp = false;
    this.#send({
      x: (xmin + xmax) / 2, y: (ymin + ymax) / 2, up: NORTH, down: MIDDLE,
      scale: FIT_SHARE * Math.min(
        this.width / Math.max(xmax - xmin, 10), this.#free / Math.max(ymax - ymin, 10)),
    }, animated);
  }

  /** Show a point of the map at a driver's scale. */
  lookAt(x: number, y: number, animated = true) {
    this.#send({ x, y, down: MIDDLE, scale: this.#driverScale() }, animated);
  }

  /**
   * Start following a vehicle; call `track` in each frame from then on.
   * @param pose where it is
   * @param headingUp whether the map turns with it
   * @param zoomed choose the scale anew
   * @param animated move gradually
   */
  beginFollowing({ x, y, yaw, speed }: Pose, headingUp: boolean, zoomed: boolean,
    animated: boolean) {
    this.headingUp = headingUp;
    this.#send({
      x, y, up: headingUp ? yaw : NORTH, down: headingUp ? FOLLOW_DOWN : MIDDLE,
      scale: zoomed ? this.#driverScale(speed) : this.#aim.scale,
    }, animated);
  }

  /** Keep a followed vehicle at the anchor. */
  track(x: number, y: number, yaw: number) {
    this.#aim.x = x;
    this.#aim.y = y;
    if (this.headingUp) {
      this.#aim.up = yaw;
    }
  }

  /** Zoom by a factor about a point of the canvas [px], the anchor by default. */
  zoom(factor: number, px = this.anchorX, py = this.anchorY, animated = false) {
    const scale = clamp(this.#aim.scale * factor, MIN_SCALE, MAX_SCALE);
    const [x, y] = this.toMap(px, py);
    const kept = this.#aim.scale / scale;
    this.#send({
      scale, x: x + (this.#aim.x - x) * kept, y: y + (this.#aim.y - y) * kept,
    }, animated);
  }

  /** Drag the map [px]. */
  pan(dx: number, dy: number) {
    const sin = Math.sin(this.up);
    const cos = Math.cos(this.up);
    this.#aim.x -= (dx * sin - dy * cos) / this.scale;
    this.#aim.y += (dx * cos + dy * sin) / this.scale;
    this.#apply();
  }

  /** Turn the map about a point of the canvas, counter-clockwise on the screen [rad]. */
  rotate(angle: number, px = this.anchorX, py = this.anchorY, animated = false) {
    this.headingUp = false;
    const [x, y] = this.toMap(px, py);
    const cos = Math.cos(-angle);
    const sin = Math.sin(-angle);
    const dx = this.#aim.x - x;
    const dy = this.#aim.y - y;
    this.#send({
      x: x + cos * dx - sin * dy, y: y + sin * dx + cos * dy, up: this.#aim.up - angle,
    }, animated);
  }

  /** Turn north up again. */
  northUp() {
    this.headingUp = false;
    this.#send({ up: NORTH, down: MIDDLE }, true);
  }

  /** Canvas x of a point of the map [px]. */
  toX(x: number, y: number) {
    return this.anchorX + this.a * (x - this.x) + this.c * (y - this.y);
  }

  /** Canvas y of a point of the map [px]. */
  toY(x: number, y: number) {
    return this.anchorY + this.b * (x - this.x) + this.d * (y - this.y);
  }

  /** Point of the map [m] under a point of the canvas [px], in a new array. */
  toMap(px: number, py: number) {
    const dx = (px - this.anchorX) / this.scale;
    const dy = (py - this.anchorY) / this.scale;
    const sin = Math.sin(this.up);
    const cos = Math.cos(this.up);
    return [this.x + dx * sin - dy * cos, this.y - dx * cos - dy * sin];
  }

  /** Return whether a box [xmin, ymin, xmax, ymax] of the map, or part of it, may be visible. */
  seesBox(box: Box) {
    return box[2] >= this.left && box[0] <= this.right
      && box[3] >= this.bottom && box[1] <= this.top;
  }

  /** Return whether something within a radius [m] of a point may be visible; false for NaN. */
  sees(x: number, y: number, radius: number) {
    return x >= this.left - radius && x <= this.right + radius
      && y >= this.bottom - radius && y <= this.top + radius;
  }

  /** Set a context to metres around a point of the map, exact at any distance from the origin. */
  enterMap(context: CanvasRenderingContext2D, ratio: number, x = this.x, y = this.y) {
    context.setTransform(ratio * this.a, ratio * this.b, ratio * this.c, ratio * this.d,
      ratio * this.toX(x, y), ratio * this.toY(x, y));
  }

  /** Set a context to metres at a pose, x forward; enlarged, and shifted down [px]. */
  enterPose(context: CanvasRenderingContext2D, ratio: number, x: number, y: number, yaw: number,
    factor = 1, down = 0) {
    const cos = ratio * factor * Math.cos(yaw);
    const sin = ratio * factor * Math.sin(yaw);
    context.setTransform(this.a * cos + this.c * sin, this.b * cos + this.d * sin,
      this.c * cos - this.a * sin, this.d * cos - this.b * sin,
      ratio * this.toX(x, y), ratio * (this.toY(x, y) + down));
  }

  #driverScale(speed = 0) {
    return Math.max(this.#free / (FOLLOW_HEIGHT + FOLLOW_TIME * speed), 2);
  }

  get #free() {
    return this.height - this.covered;
  }

  #send(aim: Partial<Aim>, animated: boolean) {
    const down = this.#down;
    const to = Object.assign(this.#aim, aim);
    to.scale = clamp(to.scale, MIN_SCALE, MAX_SCALE);
    // Until it is applied, the view is the one before.
    this.#slack = animated && !this.#still.matches ? {
      x: this.x - to.x, y: this.y - to.y, scale: Math.log(this.scale / to.scale),
      up: turn(0, this.up - to.up, 1), down: down - to.down,
    } : { x: 0, y: 0, scale: 0, up: 0, down: 0 };
    this.#apply();
  }

  get #down() {
    return this.#aim.down + this.#slack.down;
  }

  #apply() {
    this.x = this.#aim.x + this.#slack.x;
    this.y = this.#aim.y + this.#slack.y;
    this.scale = this.#aim.scale * Math.exp(this.#slack.scale);
    this.up = this.#aim.up + this.#slack.up;
    const sin = Math.sin(this.up);
    const cos = Math.cos(this.up);
    this.a = this.scale * sin;
    this.b = -this.scale * cos;
    this.c = -this.scale * cos;
    this.d = -this.scale * sin;
    const forward = this.anchorY / this.scale;
    const back = (this.height - this.anchorY) / this.scale;
    const aside = this.anchorX / this.scale;
    this.left = this.x - aside * Math.abs(sin) + Math.min(forward * cos, -back * cos);
    this.right = this.x + aside * Math.abs(sin) + Math.max(forward * cos, -back * cos);
    this.bottom = this.y - aside * Math.abs(cos) + Math.min(forward * sin, -back * sin);
    this.top = this.y + aside * Math.abs(cos) + Math.max(forward * sin, -back * sin);
  }
}

function clamp(value: number, low: number, high: number) {
  return Math.min(Math.max(value, low), high);
}

function shrink(value: number, negligible: number) {
  return Math.abs(value) < negligible ? 0 : value;
}
