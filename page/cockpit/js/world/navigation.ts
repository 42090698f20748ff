// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The navigation of the camera: following a vehicle, gestures and keys. */

import type { Box, Pose, Scene } from '../messages.js';
import type { Camera } from './camera.js';
import type { Actions } from './gestures.js';

/** The navigation of one world's camera. */
export class Navigation {
  /** Id of the followed vehicle or object, null while the camera is free. */
  followed: string | null = null;
  #camera;
  #headingUp = true;
  #begun = false;
  #zoomed = true;
  #ids: string[] = [];
  #bounds: Box | null = null;
  #sceneId: string | null = null;
  #changed;

  /** `camera` that is moved; `changed` called after each requested move. */
  constructor(camera: Camera, changed: () => void) {
    this.#camera = camera;
    this.#changed = changed;
  }

  /** Return whether the followed vehicle drives upwards on the canvas. */
  get headingUp() {
    return this.followed !== null && (this.#begun ? this.#camera.headingUp : this.#headingUp);
  }

  /**
   * Load a scene; the view stays as it is if the map is the same as before.
   * @param follow begin with the first vehicle instead of the whole map
   */
  load(scene: Scene, follow: boolean) {
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

  /** Follow a vehicle, see World.follow; if it is followed already, the scale stays. */
  follow(id: string | null, headingUp = this.#headingUp) {
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

  /** Return the view to the followed vehicle, or else to the first. */
  recenter() {
    this.follow(this.followed ?? this.#ids[0] ?? null);
    this.#zoomed = true;
  }

  /** Show the whole map, north up. */
  fit(animated = true) {
    if (this.#bounds !== null) {
      this.followed = null;
      this.#camera.fit(this.#bounds, animated);
      this.#changed();
    }
  }

  /** Toggle between heading up and north up. */
  toggleHeading() {
    if (this.followed === null) {
      this.#camera.northUp();
      this.#changed();
    } else {
      this.follow(this.followed, !this.#camera.headingUp);
    }
  }

  /** Zoom about the followed vehicle or the middle, gliding. */
  zoomBy(factor: number) {
    this.#camera.zoom(factor, undefined, undefined, true);
    this.#changed();
  }

  /** Turn about the followed vehicle or the middle, gliding [rad]. */
  turnBy(angle: number) {
    this.#camera.rotate(angle, undefined, undefined, true);
    this.#changed();
  }

  /** Return the actions of gestures, for attachGestures. */
  get hands(): Omit<Actions, 'pick'> {
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
        // A pinch always turns a little, which must not end heading up.
        if (x === undefined || !camera.headingUp) {
          camera.rotate(angle, x, y);
          this.#changed();
        }
      },
    };
  }

  /**
   * Keep up with the followed vehicle.
   * @param pose {x, y, yaw, speed} as shown, null while absent
   * @param animated move gradually to it at first
   */
  steer(pose: Pose | null, animated: boolean) {
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

  /** Fit the scene again after the canvas got its first size. */
  reframe() {
    if (this.#bounds !== null && this.followed === null) {
      this.#camera.fit(this.#bounds, false);
    }
    this.#begun = false;
  }
}
