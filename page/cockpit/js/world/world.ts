// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The world: map, vehicles and plans, drawn on a canvas in each animation frame. */

import { inEveryFrame } from '../dom.js';
import { Camera } from './camera.js';
import { hideBeyond } from './driver_sight.js';
import { attachGestures } from './gestures.js';
import { attachKeys } from './keys.js';
import { Navigation } from './navigation.js';
import { Painter } from './painter.js';
import { onThemeChange, Palette } from './palette.js';
import { keepShown } from './shown.js';
import { createToolbar } from './toolbar.js';

import type { Connection } from '../connection.js';
import type { Pose, Scene } from '../messages.js';
import type { Shown, Store } from '../store.js';
import type { Sight } from './driver_sight.js';
import type { DrawLayer, LiveView, Place, View } from './painter.js';
import type { WorldActions } from './toolbar.js';
import type { ChooseHollow, DrawnVehicle } from './vehicle_layer.js';

const FRAMES_KEPT = 600;
// A canvas whose height changes by more than this factor counts as a new map [-].
const OTHER_SIZE = 1.6;

export interface Options {
  connection?: Connection | null; // receives the wanted layers
  keys?: boolean; // whether keys are active
  toolbar?: boolean; // whether there is a toolbar
  follow?: boolean; // begin with the first vehicle instead of the whole map
  covered?: HTMLElement | null; // an element that lies over the lower edge
  sight?: () => Sight | null; // returns the seat of the user; without one, all is visible
}

/** One canvas that shows what a store holds. */
export class World {
  /** Script time of the last frames [ms], a ring buffer: frame i is at i % its length. */
  stats = { frames: 0, frame_ms: new Float32Array(FRAMES_KEPT) };
  /** The state exactly as drawn last, without invisible objects; null before. */
  shown: Shown | null = null;
  camera = new Camera();

  #canvas;
  #context;
  #store;
  #connection;
  #palette = Palette.ofTheme();
  #painter = new Painter();
  #navigation = new Navigation(this.camera, () => this.#changed());
  #toolbar: ReturnType<typeof createToolbar> | null = null;
  #follow;
  #sight;
  #dirty = true;
  // While something else is shown in its place, nothing is drawn.
  #away = false;
  #view: View;

  /** @param canvas its parent gets the toolbar */
  constructor(canvas: HTMLCanvasElement, store: Store, options: Options = {}) {
    this.#canvas = canvas;
    this.#context = canvas.getContext('2d', { alpha: false }) as CanvasRenderingContext2D;
    this.#store = store;
    this.#connection = options.connection ?? null;
    this.#follow = options.follow ?? true;
    this.#sight = options.sight ?? (() => null);
    this.#view = {
      camera: this.camera, palette: this.#palette, ratio: 1, store, scene: null, shown: null,
      insight: true,
    };
    this.#attachHands(options);
    this.#attachSizes(options.covered ?? null);
    this.#attachStore();
    inEveryFrame((now_ms) => this.#draw(now_ms));
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
   * @param id null releases the camera
   * @param headingUp turn the map so that it drives upwards; as before by default
   */
  follow(id: string | null, headingUp?: boolean) {
    this.#navigation.follow(id, headingUp);
  }

  /** Return a driven vehicle, undefined for none. */
  vehicle(index: number): DrawnVehicle | undefined {
    return this.#painter.vehicles.vehicles[index];
  }

  /** Show the whole map, north up. */
  fit(animated = true) {
    this.#navigation.fit(animated);
  }

  /**
   * Show or hide a layer.
   * @param name plans, predictions, goals, labels or object_labels, or one that was added
   * @param on whether it is shown
   * @throws {RangeError} when there is no such layer
   */
  setLayer(name: string, on: boolean) {
    this.#painter.set(name, on);
    if (name === 'predictions') {
      this.#sendLayers();
    }
    this.#changed();
  }

  /** Add an external layer; `name` for setLayer; `draw` called in each frame. */
  addLayer(name: string, draw: DrawLayer, where: Place = 'below') {
    this.#painter.add(name, draw, where);
    this.redraw();
  }

  /**
   * Set a function that chooses which things are drawn as outlines.
   * @param choose called in each frame with the input of layers; returns 1 for each vehicle, then
   *   object, that is hollow, null for none
   */
  drawHollow(choose: ChooseHollow) {
    this.#painter.vehicles.hollow = choose;
    this.redraw();
  }

  /** Draw again in the next frame even without new data. */
  redraw() {
    this.#dirty = true;
  }

  #attachHands({ keys = true, toolbar = true }: Options) {
    const navigation = this.#navigation;
    const { plans, predictions, labels } = this.#painter;
    const actions: WorldActions = {
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
          : this.#painter.vehicles.pick(x, y, this.#view as LiveView);
        if (id !== null) {
          navigation.follow(id);
        }
      },
    });
    if (keys) {
      attachKeys(actions);
    }
    if (toolbar && this.#canvas.parentElement !== null) {
      this.#toolbar = createToolbar(this.#canvas.parentElement, actions);
    }
    this.#changed();
  }

  #attachSizes(covered: HTMLElement | null) {
    onThemeChange(() => {
      this.#palette.read();
      this.redraw();
    });
    const observer = new ResizeObserver(() => this.#resize(covered));
    for (const element of [this.#canvas, covered]) {
      if (element !== null) {
        observer.observe(element);
      }
    }
  }

  #attachStore() {
    const store = this.#store;
    if (store.scene !== null) {
      this.#load(store.scene);
    }
    store.on('scene', (scene) => this.#load(scene));
    store.on('objects', (step) => this.#painter.vehicles.brakeLights.update(step));
    store.on('hello', () => this.#sendLayers());
    store.on(['state', 'objects', 'plan', 'prediction', 'perception', 'signals', 'status', 'seats',
      'events', 'epoch', 'hello'], () => this.redraw());
  }

  #resize(covered: HTMLElement | null) {
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

  #load(scene: Scene) {
    this.#painter.load(scene);
    this.#view.scene = scene;
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

  #poseOf(id: string | null): Pose | null {
    return id === null || this.shown === null ? null
      : this.#painter.vehicles.poseOf(id, this.shown);
  }

  #hideUnseen() {
    const sight = this.#sight();
    if (this.shown !== null && sight !== null) {
      hideBeyond(this.shown, this.#store.vehicleIndex(sight.id), sight.range);
    }
  }

  #draw(now_ms: number) {
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
    this.#painter.paint(this.#context, this.#view);
    this.stats.frame_ms[this.stats.frames % FRAMES_KEPT] = performance.now() - begin_ms;
    this.stats.frames += 1;
  }
}

/** @returns how much of the canvas's lower edge an element covers [CSS px] */
function coverOf(canvas: HTMLElement, covered: HTMLElement | null): number {
  if (covered === null || covered.offsetHeight === 0) {
    return 0;
  }
  return Math.max(canvas.getBoundingClientRect().bottom - covered.getBoundingClientRect().top, 0);
}
