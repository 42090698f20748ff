// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Whom the camera follows, and what hands and keys do to it. */

/** @import { Box, Pose, Scene } from '../messages.js' */
/** @import { Camera } from './camera.js' */
/** @import { Actions } from './gestures.js' */

/** Moves the camera of a world. */
export class Navigation {
  /**
   * Id of the followed vehicle or object, null while the camera is free.
   *
   * @type {string|null}
   */
  followed = null;
  #camera;
  #headingUp = true;
  #begun = false;
  #zoomed = true;
  /** @type {string[]} */
  #ids = [];
  /** @type {Box|null} */
  #bounds = null;
  /** @type {string|null} */
  #sceneId = null;
  #changed;

  /**
   * @param {Camera} camera is moved
   * @param {() => void} changed called after each move that was asked for
   */
  constructor(camera, changed) {
    this.#camera = camera;
    this.#changed = changed;
  }

  /** Return whether the followed vehicle drives upwards on the canvas. */
  get headingUp() {
    return this.followed !== null && (this.#begun ? this.#camera.headingUp : this.#headingUp);
  }

  /**
   * Take a scene over; the view stays as it is where the map is the same as before.
   *
   * @param {Scene} scene the scene document
   * @param {boolean} follow begin with the first vehicle instead of the whole map
   */
  load(scene, follow) {
    this.#ids = scene.vehicles.map(({ id }) => id);
    this.#bounds = scene.bounds;
    if (scene.id !== this.#sceneId) {
      this.#sceneId = scene.id;
      this.#camera.fit(scene.bounds, false);
      this.followed = follow ? this.#ids[0] ?? null : null;
      this.#headingUp = true;
      this.#zoomed = true;
      this.#begun = false;
    }
    this.#changed();
  }

  /**
   * See World.follow; a vehicle that is followed already keeps the scale.
   *
   * @param {string|null} id
   * @param {boolean} [headingUp]
   */
  follow(id, headingUp = this.#headingUp) {
    this.#zoomed = id !== this.followed;
    this.followed = id;
    this.#headingUp = headingUp;
    this.#begun = false;
    this.#changed();
  }

  /** Follow the next of the driven vehicles. */
  followNext() {
    if (this.#ids.length > 0) {
      this.follow(this.#ids[(this.#ids.indexOf(this.followed ?? '') + 1) % this.#ids.length]);
    }
  }

  /** Bring the followed vehicle, or else the first, back to where it belongs. */
  recenter() {
    this.follow(this.followed ?? this.#ids[0] ?? null);
    this.#zoomed = true;
  }

  /**
   * Look at a pose from near, without following.
   *
   * @param {{x: number, y: number}} pose
   */
  lookAt({ x, y }) {
    this.followed = null;
    this.#camera.lookAt(x, y);
    this.#changed();
  }

  /**
   * Show the whole map, north up.
   *
   * @param {boolean} [animated]
   */
  fit(animated = true) {
    if (this.#bounds !== null) {
      this.followed = null;
      this.#camera.fit(this.#bounds, animated);
      this.#changed();
    }
  }

  /** Heading up instead of north up, or the other way round. */
  toggleHeading() {
    if (this.followed === null) {
      this.#camera.northUp();
      this.#changed();
    } else {
      this.follow(this.followed, !this.#camera.headingUp);
    }
  }

  /**
   * Zoom about the followed vehicle or the middle, gliding.
   *
   * @param {number} factor
   */
  zoomBy(factor) {
    this.#camera.zoom(factor, undefined, undefined, true);
    this.#changed();
  }

  /**
   * Turn about the followed vehicle or the middle, gliding [rad].
   *
   * @param {number} angle
   */
  turnBy(angle) {
    this.#camera.rotate(angle, undefined, undefined, true);
    this.#changed();
  }

  /**
   * What hands do, for attachGestures.
   *
   * @returns {Omit<Actions, 'pick'>}
   */
  get hands() {
    const camera = this.#camera;
    return {
      pan: (dx, dy) => {
        this.followed = null;
        camera.pan(dx, dy);
        this.#changed();
      },
      zoom: (factor, x, y) => {
        if (this.followed === null) {
          camera.zoom(factor, x, y);
        } else {
          camera.zoom(factor);
        }
        this.#changed();
      },
      rotate: (angle, x, y) => {
        // Two fingers that pinch always turn a little: that must not end heading up.
        if (x === undefined || !camera.headingUp) {
          camera.rotate(angle, x, y);
          this.#changed();
        }
      },
    };
  }

  /**
   * Keep up with the followed vehicle.
   *
   * @param {Pose|null} pose {x, y, yaw, speed} as shown, null while absent
   * @param {boolean} animated glide to it at first
   */
  steer(pose, animated) {
    if (pose === null) {
      return;
    }
    if (this.#begun) {
      this.#camera.track(pose.x, pose.y, pose.yaw);
    } else {
      this.#camera.beginFollowing(pose, this.#headingUp, this.#zoomed, animated);
      this.#begun = true;
      this.#changed();
    }
  }

  /** Frame the scene anew after the canvas got its first size. */
  reframe() {
    if (this.#bounds !== null && this.followed === null) {
      this.#camera.fit(this.#bounds, false);
    }
    this.#begun = false;
  }
}
