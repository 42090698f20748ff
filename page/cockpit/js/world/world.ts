// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The world: map, vehicles and plans, drawn on a canvas in each animation frame. */

import { Camera } from './camera.js';
import { hideBeyond } from './driver_sight.js';
import { attachGestures } from './gestures.js';
import { attachKeys } from './keys.js';
import { Navigation } from './navigation.js';
import { Painter } from './painter.js';
import { onThemeChange, Palette } from './palette.js';
import { keepShown } from './shown.js';
import { createToolbar } from './toolbar.js';

/** @import { Connection } from '../connection.js' */
/** @import { Pose, Scene } from '../messages.js' */
/** @import { Shown, Store } from '../store.js' */
/** @import { Sight } from './driver_sight.js' */
/** @import { DrawLayer, LiveView, Place, View } from './painter.js' */
/** @import { WorldActions } from './toolbar.js' */
/** @import { ChooseHollow, DrawnVehicle } from './vehicle_layer.js' */

const FRAMES_KEPT = 600;
// A canvas whose height changes by more than this factor counts as a new map [-].
const OTHER_SIZE = 1.6;
const REDRAWN_ON = /** @type {const} */ (['state', 'objects', 'plan', 'prediction', 'perception',
  'signals', 'status', 'seats', 'events', 'epoch', 'hello']);

/**
 * @typedef {object} Options
 * @property {Connection|null} [connection] receives the wanted layers
 * @property {boolean} [keys] whether keys are active
 * @property {boolean} [toolbar] whether there is a toolbar
 * @property {boolean} [follow] begin with the first vehicle instead of the whole map
 * @property {HTMLElement|null} [covered] an element that lies over the lower edge
 * @property {() => Sight|null} [sight] returns the seat of the user; without one, all is
 *   visible
 */

/** One canvas that shows what a store holds. */
export class World {
  /** Script time of the last frames [ms], a ring buffer: frame i is at i % its length. */
  stats = { frames: 0, frame_ms: new Float32Array(FRAMES_KEPT) };
  /**
   * The state exactly as drawn last, without invisible objects; null before.
   *
   * @type {Shown|null}
   */
  shown = null;
  camera = new Camera();

  #canvas;
  #context;
  #store;
  #connection;
  #palette = Palette.ofTheme();
  #painter = new Painter();
  #navigation = new Navigation(this.camera, () => this.#changed());
  /** @type {ReturnType<typeof createToolbar>|null} */
  #toolbar = null;
  #follow;
  #sight;
  #dirty = true;
  // While something else is shown in its place, nothing is drawn.
  #away = false;
  /** @type {View} */
  #view;
  /** @type {(() => void)[]} */
  #ends = [];
  #frame = 0;

  /**
   * @param {HTMLCanvasElement} canvas its parent gets the toolbar
   * @param {Store} store what is shown
   * @param {Options} options
   */
  constructor(canvas, store, options) {
    this.#canvas = canvas;
    this.#context = /** @type {CanvasRenderingContext2D} */ (
      canvas.getContext('2d', { alpha: false }));
    this.#store = store;
    this.#connection = options.connection ?? null;
    this.#follow = options.follow ?? true;
    this.#sight = options.sight ?? (() => null);
    this.#view = {
      camera: this.camera, palette: this.#palette, ratio: 1, store, scene: null, shown: null,
      now_ms: 0, insight: true,
    };
    this.#attachHands(options);
    this.#attachSizes(options.covered ?? null);
    this.#attachStore();
    this.#frame = requestAnimationFrame((now_ms) => this.#animate(now_ms));
  }

  /** Return the id of the followed vehicle or object, null while the camera is free. */
  get followed() {
    return this.#navigation.followed;
  }

  /** Return whether AVs' plans are drawn. */
  get showsPlans() {
    return this.#painter.plans.on && this.insight;
  }

  /** Return whether plans, perception and goals of AVs may be drawn, if their layers are on. */
  get insight() {
    return this.#view.insight;
  }

  set insight(insight) {
    if (insight !== this.#view.insight) {
      this.#view.insight = insight;
      this.redraw();
    }
  }

  /**
   * Keep the camera on a vehicle or object.
   *
   * @param {string|null} id null releases the camera
   * @param {boolean} [headingUp] turn the map so that it drives upwards; as before by default
   */
  follow(id, headingUp) {
    this.#navigation.follow(id, headingUp);
  }

  /**
   * @param {number} index of a driven vehicle
   * @returns {DrawnVehicle|undefined} undefined for none
   */
  vehicle(index) {
    return this.#painter.vehicles.vehicles[index];
  }

  /**
   * Show a vehicle or object in the middle, without following it.
   *
   * @param {string|null} id
   */
  centerOn(id) {
    const pose = this.#poseOf(id);
    if (pose !== null) {
      this.#navigation.lookAt(pose);
    }
  }

  /** Show the whole map, north up. */
  fit(animated = true) {
    this.#navigation.fit(animated);
  }

  /**
   * Show or hide a layer.
   *
   * @param {string} name plans, predictions, goals, arrows, labels or object_labels, or one that
   *   was added
   * @param {boolean} on whether it is shown
   * @throws {RangeError} when there is no such layer
   */
  setLayer(name, on) {
    this.#painter.set(name, on);
    if (name === 'predictions') {
      this.#sendLayers();
    }
    this.#changed();
  }

  /**
   * Add an external layer.
   *
   * @param {string} name for setLayer
   * @param {DrawLayer} draw called in each frame
   * @param {Place} [where]
   */
  addLayer(name, draw, where = 'below') {
    this.#painter.add(name, draw, where);
    this.redraw();
  }

  /**
   * Set a function that chooses which things are drawn as outlines.
   *
   * @param {ChooseHollow} choose called in each frame with the input of layers; returns 1 for each
   *   vehicle, then object, that is hollow, null for none
   */
  drawHollow(choose) {
    this.#painter.vehicles.hollow = choose;
    this.redraw();
  }

  /** Draw again in the next frame even without new data. */
  redraw() {
    this.#dirty = true;
  }

  /** Stop the world: no more frames, keys or events. */
  close() {
    cancelAnimationFrame(this.#frame);
    this.#ends.forEach((end) => end());
  }

  /** @param {Options} options */
  #attachHands({ keys = true, toolbar = true }) {
    const navigation = this.#navigation;
    const { plans, predictions, labels } = this.#painter;
    /** @type {WorldActions} */
    const actions = {
      zoomBy: (factor) => navigation.zoomBy(factor),
      turnBy: (angle) => navigation.turnBy(angle),
      fit: () => navigation.fit(),
      followNext: () => navigation.followNext(),
      recenter: () => navigation.recenter(),
      toggleHeading: () => navigation.toggleHeading(),
      toggleLabels: () => {
        labels.next();
        this.#changed();
      },
      togglePlans: () => this.setLayer('plans', !plans.on),
      togglePredictions: () => this.setLayer('predictions', !predictions.on),
    };
    attachGestures(this.#canvas, {
      ...navigation.hands,
      pick: (x, y) => {
        const id = this.shown === null ? null
          : this.#painter.vehicles.pick(x, y, /** @type {LiveView} */ (this.#view));
        if (id !== null) {
          navigation.follow(id);
        }
      },
    });
    if (keys) {
      this.#ends.push(attachKeys(actions));
    }
    if (toolbar && this.#canvas.parentElement !== null) {
      this.#toolbar = createToolbar(this.#canvas.parentElement, actions);
    }
    this.#changed();
  }

  /** @param {HTMLElement|null} covered */
  #attachSizes(covered) {
    this.#ends.push(onThemeChange(() => {
      this.#palette.read();
      this.redraw();
    }));
    const observer = new ResizeObserver(() => this.#resize(covered));
    for (const element of [this.#canvas, covered]) {
      if (element !== null) {
        observer.observe(element);
      }
    }
    this.#ends.push(() => observer.disconnect());
  }

  #attachStore() {
    const store = this.#store;
    if (store.scene !== null) {
      this.#load(store.scene);
    }
    this.#ends.push(
      store.on('scene', (scene) => this.#load(scene)),
      store.on('objects', (step) => this.#painter.vehicles.brakeLights.update(step)),
      store.on('hello', () => this.#sendLayers()),
      store.on('events', () => this.#painter.plans.applyEvents(store.scene, store.fired)),
      ...REDRAWN_ON.map((name) => store.on(name, () => this.redraw())));
  }

  /** @param {HTMLElement|null} covered */
  #resize(covered) {
    const { clientWidth: width, clientHeight: height } = this.#canvas;
    this.#away = width === 0 || height === 0;
    if (this.#away) {
      return;
    }
    const ratio = window.devicePixelRatio || 1;
    const first = this.camera.width <= 1;
    // Setting the size clears a canvas, even if the size is the same.
    if (this.#canvas.width !== Math.round(width * ratio)
        || this.#canvas.height !== Math.round(height * ratio)) {
      this.#canvas.width = Math.round(width * ratio);
      this.#canvas.height = Math.round(height * ratio);
    }
    this.#view.ratio = ratio;
    this.#palette.read();
    const before = this.camera.height;
    this.camera.resize(width, height, Math.min(coverOf(this.#canvas, covered), height / 2));
    if (first) {
      this.#navigation.reframe();
    } else if (this.followed !== null && Math.max(height / before, before / height) > OTHER_SIZE) {
      // It has become the small map or the large one: the visible length of road stays the same.
      this.camera.zoom(height / before);
    }
    this.redraw();
    this.#draw(performance.now());
  }

  /** @param {Scene} scene */
  #load(scene) {
    this.#painter.load(scene);
    this.#view.scene = scene;
    this.#painter.plans.applyEvents(scene, this.#store.fired);
    this.#navigation.load(scene, this.#follow);
  }

  #changed() {
    this.redraw();
    const { plans, predictions, labels } = this.#painter;
    this.#toolbar?.update({
      followed: this.followed, headingUp: this.#navigation.headingUp, plans: plans.on,
      predictions: predictions.on, labels: labels.shown !== 'none',
    });
  }

  #sendLayers() {
    this.#connection?.send({ type: 'layers', predictions: this.#painter.predictions.on });
  }

  /**
   * @param {string|null} id
   * @returns {Pose|null}
   */
  #poseOf(id) {
    return id === null || this.shown === null ? null
      : this.#painter.vehicles.poseOf(id, this.shown);
  }

  /** @param {number} now_ms */
  #animate(now_ms) {
    this.#frame = requestAnimationFrame((next_ms) => this.#animate(next_ms));
    this.#draw(now_ms);
  }

  #hideUnseen() {
    const sight = this.#sight();
    if (this.shown !== null && sight !== null) {
      hideBeyond(this.shown, this.#store.vehicleIndex(sight.id), sight.range);
    }
  }

  /** @param {number} now_ms */
  #draw(now_ms) {
    if (this.#away) {
      return;
    }
    const begin_ms = performance.now();
    const shown = this.#store.displayed(now_ms);
    const stands = shown === null
      || (shown.t === this.shown?.t && shown.epoch === this.shown.epoch);
    if (stands && !this.#dirty && !this.camera.moves) {
      return;
    }
    this.#dirty = false;
    this.shown = this.#view.shown = keepShown(this.shown, shown);
    this.#hideUnseen();
    this.#navigation.steer(this.#poseOf(this.followed), this.stats.frames > 1);
    this.camera.update(now_ms);
    this.#view.now_ms = now_ms;
    this.#painter.paint(this.#context, this.#view);
    this.stats.frame_ms[this.stats.frames % FRAMES_KEPT] = performance.now() - begin_ms;
    this.stats.frames += 1;
  }
}

/**
 * @param {HTMLElement} canvas
 * @param {HTMLElement|null} covered
 * @returns {number} how much of the canvas's lower edge an element covers [CSS px]
 */
function coverOf(canvas, covered) {
  if (covered === null || covered.offsetHeight === 0) {
    return 0;
  }
  return Math.max(canvas.getBoundingClientRect().bottom - covered.getBoundingClientRect().top, 0);
}

/**
 * Show a store's world on a canvas.
 *
 * @param {HTMLCanvasElement} canvas fills its parent
 * @param {Store} store what is shown
 * @param {Options} [options]
 * @returns {World} draws from now on
 */
export function createWorld(canvas, store, options = {}) {
  return new World(canvas, store, options);
}
