// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Tells the server what the driver's 3D view shows where, if the game records their gaze. */

import { attends } from '../attending.js';
import { painted } from '../painted.js';
import { thingOf } from './contents.js';
import { ScreenPlace } from './screen_place.js';

import type { Connection } from '../connection.js';
import type { ShownThing } from '../page_messages.js';
import type { Store } from '../store.js';
import type { Picture } from './picture.js';

const EVERY_MS = 100;
// Tolerance of animation frames that arrive early [ms].
const EARLY_MS = 4;
// As many things as the server takes.
const MOST = 200;
/** Parts of the page that lie over the view, the foremost first, by their names in tables. */
const INSTRUMENTS = [['speedometer', '#hud .hud-speed'], ['dashboard', '#hud .hud-board'],
  ['map', '#stage.with-inset > #world']];

/** The pictures that are told, ten a second. */
export class ViewTeller {
  #stage;
  #store;
  #connection;
  #place = new ScreenPlace();
  #told_ms = -Infinity;

  /** @param stage that holds the picture */
  constructor(stage: HTMLElement, store: Store, connection: Connection) {
    this.#stage = stage;
    this.#store = store;
    this.#connection = connection;
  }

  /** Return whether the view of a vehicle is to be told. */
  wants(vehicle: string | null): vehicle is string {
    return vehicle !== null && this.#store.scene?.gaze?.includes(vehicle) === true
      && attends(this.#store, vehicle);
  }

  /** Tell the picture of an animation frame, if it is time. */
  tell(now_ms: number, picture: Picture, vehicle: string) {
    if (now_ms - this.#told_ms < EVERY_MS - EARLY_MS) {
      return;
    }
    const contents = picture.contents();
    if (contents === null) {
      return;
    }
    this.#told_ms = now_ms;
    const { epoch, serverClock } = this.#store;
    const place = this.#place.of(this.#stage);
    const shown = nearest([...this.#overlays(), ...contents.shown]);
    painted().then((drawn_ms) => {
      const time = serverClock.at(drawn_ms);
      if (time !== null) {
        this.#connection.send({ type: 'picture', picture: { seat: vehicle, epoch,
          steady_s: Math.round(1e6 * time.steady_s) / 1e6,
          clock_error_ms: Math.round(1e3 * time.clock_error_ms) / 1e3, place,
          eye: contents.eye, shown } });
      }
    });
  }

  /** @returns what lies over the view */
  #overlays(): ShownThing[] {
    const around = this.#stage.getBoundingClientRect();
    const entry = (kind: 'task' | 'instrument', id: string, node: Element | null) => {
      const rect = node?.getBoundingClientRect();
      if (rect === undefined || rect.width === 0 || rect.height === 0) {
        return [];
      }
      return [thingOf(kind, id, {
        left: (rect.left - around.left) / around.width,
        top: (rect.top - around.top) / around.height,
        right: (rect.right - around.left) / around.width,
        bottom: (rect.bottom - around.top) / around.height }, null)];
    };
    return [...(window.crgame.tasks?.shown ?? []).flatMap(
      ({ task, node }) => entry('task', task, node)),
    ...INSTRUMENTS.flatMap(([id, selector]) => entry(
      'instrument', id, document.querySelector(selector)))];
  }
}

/** Return the nearest things in their order; what lies over the view is nearer than all else. */
function nearest(things: ShownThing[]): ShownThing[] {
  const kept = new Set([...things].sort((one, other) => (one[6] ?? 0) - (other[6] ?? 0))
    .slice(0, MOST));
  return things.filter((thing) => kept.has(thing));
}
