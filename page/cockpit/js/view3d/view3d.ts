// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The 3D view beside the map: the choice of the two, the viewpoint and the times of drawing. */

import { element } from '../dom.js';
import { isCommand, isTyping } from '../driving/focus.js';
import { errorText } from '../panels/format.js';
import { VIEWPOINTS } from './cameras.js';
import { acrossAngle, heightAngle } from './field_of_view.js';
import { KeyAnswer } from './key_answer.js';
import { SeatClock } from './seat_clock.js';
import { createViewButtons, ViewSettings } from './view_settings.js';
import { ViewTeller } from './view_teller.js';
import { readViewWindow } from './view_window.js';

import type { Connection } from '../connection.js';
import type { Store } from '../store.js';
import type { Looks, Picture } from './picture.js';

const MISSING = 'The 3D view needs three.js, which the server does not have: '
  + '`crgame page-libraries` fetches it.';
const LOST = 'The browser has lost the graphics card: the 3D view returns when it is free.';
// While nothing moves, the mirrors are still drawn in turn.
const PICTURES_AFTER_CHANGE = 7;
// Tolerance of animation frames that arrive early [ms].
const EARLY_MS = 4;

/** The 3D view of a page. */
export class View3d {
  picture: Picture | null = null;
  settings;
  /** The settings of a window with only the view; null in a page with map and panels. */
  window = readViewWindow(window.location.search);
  /** Whether V and C change the view. */
  keys = true;
  #viewpoint = this.window?.viewpoint ?? VIEWPOINTS[0];
  #stage;
  #store;
  #teller;
  #clock;
  #canvas = element('canvas', { id: 'view3d', role: 'img', 'aria-label': '3D view',
    'aria-describedby': 'around', tabindex: 0, hidden: true });
  #buttons;
  #on = false;
  #frame = 0;
  #due = 0;
  #drawn_ms = -Infinity;
  #shown_t = NaN;
  #answer = new KeyAnswer();
  #wasLost = false;

  constructor(stage: HTMLElement, store: Store, connection: Connection) {
    this.#stage = stage;
    this.#store = store;
    this.#teller = new ViewTeller(stage, store, connection);
    this.#clock = new SeatClock(store, this.window !== null,
      this.window?.vehicle ?? null);
    stage.prepend(this.#canvas);
    this.settings = new ViewSettings(() => this.redraw());
    this.#buttons = createViewButtons(stage, this.settings, {
      toggle: () => this.show(!this.#on),
      choose: (viewpoint) => { this.viewpoint = viewpoint; },
    });
    this.redraw();
    window.addEventListener('keydown', (event) => this.#pressed(event));
    for (const name of ['keydown', 'keyup'] as const) {
      // Driving stops its keys from propagating, so they are captured earlier.
      window.addEventListener(name, (event) => this.#awaitAnswer(event), true);
    }
    new ResizeObserver(() => this.#resize()).observe(stage);
    store.on(['scene', 'epoch', 'plan', 'state', 'signals', 'events'], () => {
      this.#due = PICTURES_AFTER_CHANGE;
    });
    if (this.window !== null) {
      document.documentElement.classList.add('view-window');
      this.show(true);
    }
  }

  /** Return whether the 3D view is shown instead of the map. */
  get on() {
    return this.#on;
  }

  get viewpoint() {
    return this.#viewpoint;
  }

  set viewpoint(viewpoint) {
    this.#viewpoint = viewpoint;
    this.redraw();
  }

  /** Return the figures of the last picture; null before the view was first opened. */
  get stats() {
    return this.picture?.stats ?? null;
  }

  /** Return the id of the vehicle from which it looks, null for none. */
  get vehicle() {
    const { driving, world } = window.crgame;
    const wanted = [this.window?.vehicle, this.#clock.vehicle, driving?.seat, world?.followed];
    return wanted.find((id) => this.#store.vehicle(id) !== undefined)
      ?? this.#store.scene?.vehicles[0]?.id ?? null;
  }

  /** Show the 3D view or the map; return whether it is shown: it needs three.js and WebGL 2. */
  async show(on: boolean): Promise<boolean> {
    this.#on = on && await this.#load();
    this.#canvas.hidden = !this.#on;
    this.redraw();
    this.#resize();
    cancelAnimationFrame(this.#frame);
    if (this.#on) {
      this.#frame = requestAnimationFrame((now_ms) => this.#animate(now_ms));
    }
    return this.#on;
  }

  /** Switch to the next viewpoint. */
  next() {
    this.viewpoint = VIEWPOINTS[(VIEWPOINTS.indexOf(this.#viewpoint) + 1) % VIEWPOINTS.length];
  }

  /**
   * Draw once more and return it as PNG, because the browser discards the drawing after a frame.
   * @returns null while nothing can be seen
   */
  async snapshot(): Promise<Blob | null> {
    const now_ms = performance.now();
    const shown = this.#on ? this.#store.displayed(now_ms) : null;
    if (shown === null || !this.picture?.draw(shown, now_ms, this.#view(this.vehicle))) {
      return null;
    }
    return new Promise((resolve) => { this.#canvas.toBlob(resolve); });
  }

  /** Draw again even if nothing has moved. */
  redraw() {
    this.#due = PICTURES_AFTER_CHANGE;
    const { classList } = this.#stage;
    const seen = { 'in-3d': this.#on, 'as-driver': this.#on && this.#viewpoint === 'driver',
      'with-inset': this.#on && this.settings?.switches.inset };
    for (const [name, on] of Object.entries(seen)) {
      classList.toggle(name, Boolean(on));
    }
    // One switch for the picture and the small map in it, which has no buttons.
    const { world } = window.crgame;
    world.insight = !this.#on || this.settings?.switches.plans === true;
    world.redraw();
    this.#buttons?.update(this.#on, this.#viewpoint);
  }

  async #load() {
    if (this.picture !== null) {
      return true;
    }
    let three: typeof import('./three.js');
    try {
      three = await import('./three.js');
    } catch {
      this.#notify(MISSING);
      return false;
    }
    try {
      const module = await import('./picture.js');
      this.picture ??= new module.Picture(three, this.#canvas, this.#store);
      return true;
    } catch (error) {
      this.#notify(`The 3D view cannot be drawn: ${errorText(error)}`);
      return false;
    }
  }

  #notify(text: string) {
    this.#store.receive({ type: 'notice', level: 'warn', text });
  }

  #pressed(event: KeyboardEvent) {
    if (!this.keys || event.repeat || !isCommand(event)) {
      return;
    }
    const key = event.key.toLowerCase();
    if (key === 'v') {
      this.show(!this.#on);
    } else if (key === 'c' && this.#on) {
      this.next();
    }
  }

  #awaitAnswer(event: KeyboardEvent) {
    const newest = this.#store.latest;
    if (!event.repeat && newest !== undefined && window.crgame.driving?.seat
        && !isTyping(event.target)) {
      this.#answer.pressed(newest.t, this.#store.clock.rate);
    }
  }

  #resize() {
    if (this.#on && this.#stage.clientWidth > 0 && this.#stage.clientHeight > 0) {
      this.picture?.resize(this.#stage.clientWidth, this.#stage.clientHeight);
      this.redraw();
    }
  }

  #animate(now_ms: number) {
    if (!this.#on || this.picture === null) {
      return;
    }
    this.#frame = requestAnimationFrame((next_ms) => this.#animate(next_ms));
    this.#notifyLoss(this.picture);
    this.#clock.follow(now_ms);
    const { vehicle, picture } = this;
    const told = this.window === null && this.#teller.wants(vehicle);
    if (told !== picture.keepsPlaces) {
      picture.keepsPlaces = told;
      this.redraw();
    }
    this.#draw(now_ms, picture, vehicle);
    if (told) {
      this.#teller.tell(now_ms, picture, vehicle);
    }
  }

  #draw(now_ms: number, picture: Picture, vehicle: string | null) {
    const shown = this.#store.displayed(now_ms);
    const early = now_ms - this.#drawn_ms < picture.period_ms - EARLY_MS;
    if (shown === null || (shown.t === this.#shown_t && this.#due === 0)
        || (early && !this.#answer.isDue(shown.t))) {
      return;
    }
    this.#clock.send(now_ms, shown.t, vehicle);
    picture.sharp = this.settings.switches.sharp;
    if (picture.draw(shown, now_ms, this.#view(vehicle))) {
      this.#due = shown.t === this.#shown_t ? this.#due - 1 : PICTURES_AFTER_CHANGE;
      this.#shown_t = shown.t;
      this.#drawn_ms = now_ms;
      if (early) {
        this.#answer.drawn();
      }
    }
  }

  #view(vehicle: string | null): Looks {
    const { clientWidth: width, clientHeight: height } = this.#stage;
    const { seat, fieldOfView_deg, switches } = this.settings;
    const across = acrossAngle(this.window?.fieldOfView_deg ? null : seat,
      this.window?.fieldOfView_deg ?? fieldOfView_deg, width, window.screen.width);
    return {
      viewpoint: this.#viewpoint, index: this.#store.vehicleIndex(vehicle ?? ''),
      aside: this.window?.aside ?? 0, height: heightAngle(across, width / height),
      mirrors: switches.mirrors && this.window === null, plans: switches.plans,
    };
  }

  #notifyLoss(picture: Picture) {
    if (picture.lost !== this.#wasLost) {
      this.#wasLost = picture.lost;
      if (picture.lost) {
        this.#notify(LOST);
      } else {
        this.redraw();
      }
    }
  }
}
