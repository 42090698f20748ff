// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The 3D view beside the map: its buttons and keys, and which of the two is drawn. */

import { element } from '../dom.js';
import { VEHICLE, VEHICLE_WIDTH } from '../frames.js';
import { isTyping } from '../driving/focus.js';
import { press, toolButton } from '../world/toolbar.js';
import { above, chasing, mountedAt, VIEWPOINTS } from './cameras.js';

/** @import { Store } from '../store.js' */
/** @import { CameraPose, Viewpoint } from './cameras.js' */
/** @import { Picture } from './picture.js' */

const ICONS = {
  cube: 'M12 3l8 4.5v9L12 21l-8-4.5v-9zM12 12l8-4.5M12 12v9M12 12L4 7.5',
  eye: 'M2 12s4-6 10-6s10 6 10 6s-4 6-10 6s-10-6-10-6M12 9.5a2.5 2.5 0 1 0 0 5a2.5 2.5 0 1 0 0-5',
};
const EYE = { x: 1.1, y: 0.35, z: 1.2 };
const MISSING = 'The 3D view needs three.js, which the server does not have: '
  + '`crgame cockpit-3d` fetches it.';

/** The 3D view of a page. */
export class View3d {
  /** @type {Picture|null} */
  picture = null;
  /** @type {Viewpoint} */
  viewpoint = 'driver';
  #stage;
  #store;
  #canvas = element('canvas', { id: 'view3d', 'aria-label': '3D view', hidden: true });
  #buttons;
  #on = false;

  /**
   * @param {HTMLElement} stage
   * @param {Store} store
   */
  constructor(stage, store) {
    this.#stage = stage;
    this.#store = store;
    stage.prepend(this.#canvas);
    this.#buttons = this.#addButtons();
    window.addEventListener('keydown', (event) => this.#pressed(event));
    new ResizeObserver(() => this.#resize()).observe(stage);
  }

  /** Whether it is shown in place of the map. */
  get on() {
    return this.#on;
  }

  /** What the last picture took; null before the view was first opened. */
  get stats() {
    return this.picture?.stats ?? null;
  }

  /**
   * Show it, or the map.
   *
   * @param {boolean} on
   * @returns {Promise<boolean>} whether it is shown: it cannot be without three.js and WebGL 2
   */
  async show(on) {
    this.#on = on && await this.#load();
    this.#canvas.hidden = !this.#on;
    this.#stage.classList.toggle('in-3d', this.#on);
    press(this.#buttons.cube, this.#on);
    this.#buttons.eye.hidden = !this.#on;
    this.#resize();
    if (this.#on) {
      requestAnimationFrame((now_ms) => this.#animate(now_ms));
    }
    return this.#on;
  }

  /** Look from the next viewpoint. */
  next() {
    this.viewpoint = VIEWPOINTS[(VIEWPOINTS.indexOf(this.viewpoint) + 1) % VIEWPOINTS.length];
  }

  async #load() {
    if (this.picture === null) {
      try {
        const three = await import('./three.js');
        const { Picture } = await import('./picture.js');
        this.picture = new Picture(three, this.#canvas, this.#store);
      } catch (error) {
        const missing = error instanceof TypeError;
        this.#store.receive({ type: 'notice', level: 'warn',
          text: missing ? MISSING : `The 3D view cannot be drawn: ${error}` });
        return false;
      }
    }
    return true;
  }

  #addButtons() {
    const group = element('div', { class: 'world-group' });
    const buttons = {
      cube: toolButton(group, ICONS.cube, '3D view or map (V)', () => this.show(!this.#on)),
      eye: toolButton(group, ICONS.eye, 'Next viewpoint: driver, chase, bird (C)',
        () => this.next()),
    };
    buttons.eye.hidden = true;
    press(buttons.cube, false);
    this.#stage.querySelector('.world-toolbar')?.append(group);
    return buttons;
  }

  /** @param {KeyboardEvent} event */
  #pressed(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.repeat
        || isTyping(event.target)) {
      return;
    }
    const key = event.key.toLowerCase();
    if (key === 'v') {
      this.show(!this.#on);
    } else if (key === 'c' && this.#on) {
      this.next();
    }
  }

  #resize() {
    if (this.#on) {
      this.picture?.resize(this.#stage.clientWidth, this.#stage.clientHeight);
    }
  }

  /** @param {number} now_ms */
  #animate(now_ms) {
    if (!this.#on) {
      return;
    }
    requestAnimationFrame((next_ms) => this.#animate(next_ms));
    const pose = this.#pose(now_ms);
    if (pose !== null) {
      this.picture?.draw(now_ms, pose);
    }
  }

  /**
   * @param {number} now_ms
   * @returns {CameraPose|null}
   */
  #pose(now_ms) {
    const rows = this.#store.displayed(now_ms)?.vehicles;
    const index = Math.max(
      this.#store.vehicleIndex(window.crgame.driving?.seat ?? window.crgame.world.followed ?? ''),
      0);
    const row = index * VEHICLE_WIDTH;
    const vehicle = this.#store.scene?.vehicles[index];
    if (rows === undefined || vehicle === undefined || !Number.isFinite(rows[row])) {
      return null;
    }
    const pose = { x: rows[row], y: rows[row + 1], yaw: rows[row + VEHICLE.yaw] };
    const ground = this.picture?.heightAt(pose.x, pose.y) ?? 0;
    switch (this.viewpoint) {
      case 'chase': return chasing(pose, ground, vehicle.shape.length);
      case 'bird': return above(pose, ground);
      default: return mountedAt(pose, ground, EYE);
    }
  }
}

/**
 * Put the 3D view beside the map.
 *
 * @param {HTMLElement} root the stage, which holds the map
 * @param {Store} store what is shown
 * @returns {View3d}
 */
export function createView3d(root, store) {
  return new View3d(root, store);
}
