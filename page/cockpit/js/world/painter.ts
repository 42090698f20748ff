// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The world's layers, in the order in which they are painted, with north arrow and scale bar. */

import { LabelLayer } from './label_layer.js';
import { MapLayer } from './map_layer.js';
import { PlanLayer, PredictionLayer } from './plan_layer.js';
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

const LONGEST_BAR_REM = 6.5;
// On a narrower canvas, such as the small map, they would cover the content.
const NARROW_REM = 21;
const lengths = [0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000, 20000];
const texts = lengths.map((length) => (length < 1000 ? `${length} m` : `${length / 1000} km`));

/** Draw both if there is room; `view`: camera, palette and ratio. */
function drawOverlay(context: CanvasRenderingContext2D,
  { camera, palette, ratio }: Pick<View, 'camera' | 'palette' | 'ratio'>) {
  const rem = palette.rem_px;
  if (camera.width < NARROW_REM * rem) {
    return;
  }
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  let index = 0;
  while (index < lengths.length - 1
      && lengths[index + 1] * camera.scale <= LONGEST_BAR_REM * rem) {
    index += 1;
  }
  const length = lengths[index] * camera.scale;
  const width = Math.max(length, 3 * rem) + 4 * rem;
  context.fillStyle = palette.labelGround;
  context.beginPath();
  context.roundRect(camera.width - width - 0.7 * rem, 0.7 * rem, width, 3.2 * rem, 0.5 * rem);
  context.fill();
  drawBar(context, palette, camera.width - 3.7 * rem, 2.9 * rem, length, texts[index]);
  drawNorth(context, camera, palette, ratio, camera.width - 2.2 * rem, 2.3 * rem);
}

function drawBar(context: CanvasRenderingContext2D, palette: Colors, right: number, y: number,
  length: number, text: string) {
  const rem = palette.rem_px;
  context.strokeStyle = palette.overlay;
  context.lineWidth = Math.max(rem / 9, 1);
  context.beginPath();
  context.moveTo(right - length, y - 0.4 * rem);
  context.lineTo(right - length, y);
  context.lineTo(right, y);
  context.lineTo(right, y - 0.4 * rem);
  context.stroke();
  context.fillStyle = palette.overlay;
  context.font = `${Math.max(12, 0.85 * rem)}px system-ui, 'DejaVu Sans', sans-serif`;
  context.textAlign = 'right';
  context.textBaseline = 'alphabetic';
  context.fillText(text, right, y - 0.7 * rem);
}

function drawNorth(context: CanvasRenderingContext2D, camera: Camera, palette: Colors,
  ratio: number, x: number, y: number) {
  const rem = palette.rem_px;
  // On the canvas, north is the direction of the matrix's second column.
  const east = camera.a / camera.scale;
  const skew = camera.b / camera.scale;
  context.setTransform(ratio * east, ratio * skew, -ratio * skew, ratio * east,
    ratio * x, ratio * y);
  context.fillStyle = palette.overlay;
  context.beginPath();
  context.moveTo(0, -1.2 * rem);
  context.lineTo(0.5 * rem, 0.1 * rem);
  context.lineTo(0, -0.15 * rem);
  context.lineTo(-0.5 * rem, 0.1 * rem);
  context.closePath();
  context.fill();
  context.font = `600 ${Math.max(12, 0.85 * rem)}px system-ui, 'DejaVu Sans', sans-serif`;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.fillText('N', 0, 0.75 * rem);
}
