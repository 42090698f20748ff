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

import type { Scene } from '../messages.js';
import type { Shown, Store } from '../store.js';
import type { Camera } from './camera.js';
import type { Colors } from './palette.js';

/** The input of layers. */
export interface View {
  camera: Camera; // enterMap and enterPose set a context up for metres
  palette: Colors;
  ratio: number; // of device pixels to CSS pixels
  store: Store;
  scene: Scene | null;
  shown: Shown | null;
  insight: boolean; // whether plans, perception and goals of AVs may be drawn
}

/** Once there is something to show. */
export interface LiveView extends View { scene: Scene; shown: Shown }
export type DrawLayer = (context: CanvasRenderingContext2D, view: LiveView) => void;
export type Place = 'below' | 'above'; // below or above the vehicles
export type Layers = Map<string, { draw: DrawLayer; on: boolean }>; // by name

/** All layers of one world. */
export class Painter {
  map = new MapLayer();
  signals = new SignalLayer();
  vehicles = new VehicleLayer();
  plans = new PlanLayer();
  predictions = new PredictionLayer();
  labels = new LabelLayer();
  #extra: Record<Place, Layers> = { below: new Map(), above: new Map() };

  /** @param scene the scene document */
  load(scene: Scene) {
    for (const layer of [this.map, this.signals, this.vehicles]) {
      layer.load(scene);
    }
  }

  /** Add an external layer, which replaces one of the same name; see World.addLayer. */
  add(name: string, draw: DrawLayer, where: Place) {
    this.#extra.below.delete(name);
    this.#extra.above.delete(name);
    this.#extra[where].set(name, { draw, on: true });
  }

  /**
   * Show or hide a layer.
   * @param name as for World.setLayer
   * @param on whether it is shown
   * @throws {RangeError} when there is no such layer
   */
  set(name: string, on: boolean) {
    switch (name) {
      case 'plans': this.plans.on = on; break;
      case 'predictions': this.predictions.on = on; break;
      case 'goals': this.map.goals = on; break;
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

  /** Paint one frame. */
  paint(context: CanvasRenderingContext2D, view: View) {
    context.globalAlpha = 1;
    this.map.draw(context, view);
    if (view.scene !== null) {
      const live = view.shown === null ? null : view as LiveView;
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

  #paintMoving(context: CanvasRenderingContext2D, view: LiveView) {
    paintExtra(this.#extra.below, context, view);
    if (view.insight) {
      this.plans.draw(context, view, this.vehicles.vehicles);
      this.predictions.draw(context, view, this.vehicles);
    }
    this.vehicles.draw(context, view);
    paintExtra(this.#extra.above, context, view);
  }
}

function paintExtra(layers: Layers, context: CanvasRenderingContext2D, view: LiveView) {
  for (const { draw, on } of layers.values()) {
    if (on) {
      context.save();
      draw(context, view);
      context.restore();
    }
  }
}
