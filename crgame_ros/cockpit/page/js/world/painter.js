// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The world's layers, in the order in which they are painted. */

import { LabelLayer } from './label_layer.js';
import { MapLayer } from './map_layer.js';
import { drawOverlay } from './overlay.js';
import { PlanLayer } from './plan_layer.js';
import { PredictionLayer } from './prediction_layer.js';
import { SignalLayer } from './signal_layer.js';
import { VehicleLayer } from './vehicle_layer.js';

/** All layers of one world. */
export class Painter {
  map = new MapLayer();
  signals = new SignalLayer();
  vehicles = new VehicleLayer();
  plans = new PlanLayer();
  predictions = new PredictionLayer();
  labels = new LabelLayer();
  #extra = { below: new Map(), above: new Map() };

  /** @param {object} scene the scene document */
  load(scene) {
    for (const layer of [this.map, this.signals, this.vehicles]) {
      layer.load(scene);
    }
  }

  /** Add a layer of somebody else's, in place of one of the same name; see World.addLayer. */
  add(name, draw, where) {
    this.#extra.below.delete(name);
    this.#extra.above.delete(name);
    this.#extra[where].set(name, { draw, on: true });
  }

  /**
   * Show or hide a layer.
   *
   * @param {string} name as World.setLayer takes it
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
   * @param {object} view camera, palette, ratio, store, scene, shown, now_ms
   */
  paint(context, view) {
    context.globalAlpha = 1;
    this.map.draw(context, view);
    if (view.scene !== null) {
      this.signals.drawBars(context, view);
      if (view.shown !== null) {
        this.#paintMoving(context, view);
      }
      this.signals.drawLamps(context, view);
      if (view.shown !== null) {
        this.labels.draw(context, view, this.vehicles);
      }
    }
    drawOverlay(context, view);
  }

  #paintMoving(context, view) {
    paintExtra(this.#extra.below, context, view);
    this.plans.draw(context, view, this.vehicles.vehicles);
    this.predictions.draw(context, view, this.vehicles);
    this.vehicles.draw(context, view);
    paintExtra(this.#extra.above, context, view);
  }
}

function paintExtra(layers, context, view) {
  for (const { draw, on } of layers.values()) {
    if (on) {
      context.save();
      draw(context, view);
      context.restore();
    }
  }
}
