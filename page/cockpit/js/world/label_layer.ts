// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The ids of vehicles and objects, beside them and always upright. */

import { OBJECT_WIDTH, VEHICLE, VEHICLE_WIDTH } from '../frames.js';

import type { LiveView, View } from './painter.js';
import type { Thing, VehicleLayer } from './vehicle_layer.js';

// Objects' ids are not drawn where they would cover each other [px/m].
const OBJECTS_FROM = 1.5;
const FONT_REM = 0.85;
// Most labels that make room for each other.
const MOST_PLACED = 24;
const NEXT = { vehicles: 'all', all: 'none', none: 'vehicles' } as const;

/** Ids of driven vehicles, and of objects on request. */
export class LabelLayer {
  /** The ids that are shown. */
  shown: 'none' | 'vehicles' | 'all' = 'vehicles';
  #widths = new Map<string, number>();
  #font = '';
  #places: { x: number; y: number; width: number }[] = [];
  #placed = 0;

  /** Switch to the next of the three settings. */
  next() {
    this.shown = NEXT[this.shown];
  }

  /** Draw the ids over everything. */
  draw(context: CanvasRenderingContext2D, view: LiveView, layer: VehicleLayer) {
    if (this.shown === 'none') {
      return;
    }
    const { camera, shown, store, palette, ratio } = view;
    const size_px = Math.max(12, FONT_REM * palette.rem_px);
    const font = `600 ${size_px}px system-ui, 'DejaVu Sans', sans-serif`;
    if (font !== this.#font) {
      this.#font = font;
      this.#widths.clear();
    }
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.font = font;
    context.textAlign = 'center';
    context.textBaseline = 'middle';
    this.#placed = 0;
    if (this.shown === 'all' && camera.scale > OBJECTS_FROM) {
      for (let i = 0; i < layer.objects.length; i += 1) {
        this.#draw(context, view, layer.objects[i].id, layer.objects[i],
          shown.objects[i * OBJECT_WIDTH], shown.objects[i * OBJECT_WIDTH + 1]);
      }
    }
    for (let i = 0; i < layer.vehicles.length; i += 1) {
      const vehicle = layer.vehicles[i];
      const row = i * VEHICLE_WIDTH;
      const yaw = shown.vehicles[row + VEHICLE.yaw];
      const name = store.holds(vehicle.id) ? `${vehicle.id} · you` : vehicle.id;
      this.#draw(context, view, name, vehicle,
        shown.vehicles[row] + vehicle.rear_to_center * Math.cos(yaw),
        shown.vehicles[row + 1] + vehicle.rear_to_center * Math.sin(yaw));
    }
  }

  /** Move a label down until it covers no other; return its y [px]. */
  #free(px: number, py: number, width: number, height: number) {
    let y = py;
    for (let i = 0; i < this.#placed; i += 1) {
      const other = this.#places[i];
      if (Math.abs(other.x - px) < (other.width + width) / 2 && Math.abs(other.y - y) < height) {
        y = other.y + height;
      }
    }
    this.#places[this.#placed] ??= { x: 0, y: 0, width: 0 };
    const place = this.#places[this.#placed];
    place.x = px;
    place.y = y;
    place.width = width;
    this.#placed = Math.min(this.#placed + 1, MOST_PLACED);
    return y;
  }

  #draw(context: CanvasRenderingContext2D, { camera, palette }: View, text: string, thing: Thing,
    x: number, y: number) {
    if (!camera.sees(x, y, thing.look.radius)) {
      return;
    }
    let width = this.#widths.get(text);
    if (width === undefined) {
      width = context.measureText(text).width;
      this.#widths.set(text, width);
    }
    const height = 1.35 * Math.max(12, FONT_REM * palette.rem_px);
    const px = camera.toX(x, y);
    // Below it on the screen, so that with heading up the area ahead of a vehicle stays free.
    let py = camera.toY(x, y) + Math.max(0.6 * thing.look.extent * camera.scale, 9)
      + 0.6 * height;
    py = this.#free(px, py, width + 12, height + 3);
    context.fillStyle = palette.labelGround;
    context.beginPath();
    context.roundRect(px - width / 2 - 5, py - height / 2, width + 10, height, height / 3);
    context.fill();
    context.fillStyle = palette[thing.color];
    context.fillRect(px - width / 2 - 5 + height / 4, py + height / 2 - 2,
      width + 10 - height / 2, 2);
    context.fillStyle = palette.label;
    context.fillText(text, px, py + 0.5);
  }
}
