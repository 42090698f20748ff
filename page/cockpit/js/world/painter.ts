// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The world's layers, in the order in which they are painted. */

import { LabelLayer } from './label_layer.js';
import { MapLayer } from './map_layer.js';
import { drawOverlay } from './overlay.js';
import { PlanLayer } from './plan_layer.js';
import { PredictionLayer } from './prediction_layer.js';
import { SignalLayer } from './signal_layer.js';
import { VehicleLayer } from './vehicle_layer.js';

/** @import { Scene } from '../messages.js' */
/** @import { Shown, Store } from '../store.js' */
/** @import { Camera } from './camera.js' */
/** @import { Colors } from './palette.js' */

/**
 * The input of layers.
 *
 * @typedef {object} View
 * @property {Camera} camera enterMap and enterPose set a context up for metres
 * @property {Colors} palette
 * @property {number} ratio of device pixels to CSS pixels
 * @property {Store} store
 * @property {Scene|null} scene
 * @property {Shown|null} shown
 * @property {number} now_ms
 * @property {boolean} insight whether plans, perception and goals of AVs may be drawn
 */

/**
 * @typedef {View & {scene: Scene, shown: Shown}} LiveView once there is something to show
 * @typedef {(context: CanvasRenderingContext2D, view: LiveView) => void} DrawLayer
 * @typedef {'below'|'above'} Place below or above the vehicles
 * @typedef {Map<string, {draw: DrawLayer, on: boolean}>} Layers by name
 */

/** All layers of one world. */
export class Painter {
  map = new MapLayer();
  signals = new SignalLayer();
  vehicles = new VehicleLayer();
  plans = new PlanLayer();
  predictions = new PredictionLayer();
  labels = new LabelLayer();
  /** @type {Record<Place, Layers>} */
  #extra = { below: new Map(), above: new Map() };

  /** @param {Scene} scene the scene document */
  load(scene) {
    for (const layer of [this.map, this.signals, this.vehicles]) {
      layer.load(scene);
    }
  }

  /**
   * Add an external layer, which replaces one of the same name; see World.addLayer.
   *
   * @param {string} name
   * @param {DrawLayer} draw
   * @param {Place} where
   */
  add(name, draw, where) {
    this.#extra.below.delete(name);
    this.#extra.above.delete(name);
    this.#extra[where].set(name, { draw, on: true });
  }

  /**
   * Show or hide a layer.
   *
   * @param {string} name as for World.setLayer
   * @param {boolean} on whether it is shown
   * @throws {RangeError} when there is no such layer
   */
  set(name, on) {
    switch (name) {
      case 'plans': this.plans.on = on; break;
      case 'predictions': this.predictions.on = on; break;
      case 'goals': this.map.goals = on; break;
      case 'arrows': this.map.arrows = on; break;
      case 'labels': this.labels.shown = on ? 'vehicles' : 'none'; break;
      case 'object_labels': this.labels.shown = on ? 'all' : 'vehicles'; break;
      default: {
        const layer = this.#extra.below.get(name) ?? this.#extra.above.get(name);
        if (layer === undefined) {
          throw new RangeError(`the world has no layer '${name}'`);
        }
        layer.on = on;
      }
    }
  }

  /**
   * Paint one frame.
   *
   * @param {CanvasRenderingContext2D} context of the canvas
   * @param {View} view camera, palette, ratio, store, scene, shown, now_ms
   */
  paint(context, view) {
    context.globalAlpha = 1;
    this.map.draw(context, view);
    if (view.scene !== null) {
      const live = view.shown === null ? null : /** @type {LiveView} */ (view);
      this.signals.drawBars(context, view);
      if (live !== null) {
        this.#paintMoving(context, live);
      }
      this.signals.drawLamps(context, view);
      if (live !== null) {
        this.labels.draw(context, live, this.vehicles);
      }
    }
    drawOverlay(context, view);
  }

  /**
   * @param {CanvasRenderingContext2D} context
   * @param {LiveView} view
   */
  #paintMoving(context, view) {
    paintExtra(this.#extra.below, context, view);
    if (view.insight) {
      this.plans.draw(context, view, this.vehicles.vehicles);
      this.predictions.draw(context, view, this.vehicles);
    }
    this.vehicles.draw(context, view);
    paintExtra(this.#extra.above, context, view);
  }
}

/**
 * @param {Layers} layers
 * @param {CanvasRenderingContext2D} context
 * @param {LiveView} view
 */
function paintExtra(layers, context, view) {
  for (const { draw, on } of layers.values()) {
    if (on) {
      context.save();
      draw(context, view);
      context.restore();
    }
  }
}
