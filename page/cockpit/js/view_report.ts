// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The report of this page's view to the server, which records the views of drivers. */

import { DEGREES } from './units.js';
import { fillsScreen } from './view3d/screen_place.js';

import type { Connection } from './connection.js';
import type { ViewMessage } from './messages.js';
import type { Store } from './store.js';

const CHECK_EVERY_MS = 100;
// The picture rate is reported once a second [ms].
const SEND_EVERY_MS = 1000;

/** A periodic report of the view; in `window.crgame.viewReport`. */
export class ViewReport {
  #connection;
  #store;
  #stage;
  #sent = '';
  #sent_ms = -Infinity;
  #pictures = 0;

  /** @param stage that holds the picture */
  constructor(stage: HTMLElement, store: Store, connection: Connection) {
    this.#stage = stage;
    this.#store = store;
    this.#connection = connection;
    store.on('hello', () => {
      this.#sent = '';
    });
    setInterval(() => this.#report(), CHECK_EVERY_MS);
  }

  #report() {
    const now_ms = performance.now();
    const since_ms = now_ms - this.#sent_ms;
    const text = JSON.stringify(this.#choice);
    if (this.#store.mode !== 'live' || window.crgame.ready !== true
        || (text === this.#sent && since_ms < SEND_EVERY_MS)) {
      return;
    }
    const pictures = countPictures();
    // The picture rate of a view that was just opened is not known yet.
    const rate_hz = text === this.#sent ? 1000 * (pictures - this.#pictures) / since_ms : null;
    if (this.#connection.send({ ...this.#choice, ratio: this.#ratio, rate_hz })) {
      this.#sent = text;
      this.#sent_ms = now_ms;
      this.#pictures = pictures;
    }
  }

  /** @returns the settings that only the user changes */
  get #choice(): Omit<ViewMessage, 'ratio' | 'rate_hz'> {
    const { view3d, world, stage } = window.crgame;
    const { clientWidth: width_px, clientHeight: height_px } = this.#stage;
    const rest = { width_px, height_px, bare: Number(stage !== undefined), away: this.#away,
      full_screen: Number(fillsScreen()), stage: stage?.address.seat ?? '' };
    const picture = view3d?.on ? view3d.picture : null;
    if (view3d === undefined || picture === null) {
      return { type: 'view', shown: 'map', inset: 0, mirrors: 0, across_deg: null,
        plans: Number(world.showsPlans), screen_width_m: null, eye_distance_m: null,
        renderer: '', software: 0, ...rest };
    }
    const { inset, plans, mirrors } = view3d.settings.switches;
    const { fov, aspect } = picture.camera;
    const across = 2 * Math.atan(Math.tan(fov / DEGREES / 2) * aspect);
    const seat = view3d.settings.seat;
    return {
      type: 'view', shown: view3d.viewpoint, inset: Number(inset),
      plans: Number(plans),
      mirrors: Number(mirrors && view3d.viewpoint === 'driver'),
      across_deg: Math.round(across * DEGREES * 10) / 10,
      screen_width_m: seat?.screen_width_m ?? null, eye_distance_m: seat?.eye_distance_m ?? null,
      renderer: picture.stats.renderer, software: Number(picture.stats.software), ...rest,
    };
  }

  /** @returns why the driver's inputs have no effect; empty while they have */
  get #away(): string {
    return window.crgame.driving?.away
      ?? (document.visibilityState !== 'visible' ? 'hidden' : document.hasFocus() ? '' : 'focus');
  }

  get #ratio() {
    const { view3d } = window.crgame;
    return view3d?.on && view3d.picture !== null ? view3d.picture.stats.ratio
      : window.devicePixelRatio;
  }
}

/** Return how many pictures the shown view has drawn. */
export function countPictures(): number {
  const { view3d, world } = window.crgame;
  return view3d?.on ? view3d.stats?.frames ?? 0 : world.stats.frames;
}
