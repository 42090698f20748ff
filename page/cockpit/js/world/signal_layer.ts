// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Traffic lights: the lamps in their housing, and the state across the end of each lane. */

import { LIT } from '../lights.js';

import type { Light, Scene } from '../messages.js';
import type { View } from './painter.js';

// Lamps differ in place too, for colour-blind users.
const LAMPS = [['red', '#ff4b3e'], ['yellow', '#ffc933'], ['green', '#19c37d']];
const OFF = '#3a3f47';
const HOUSING = '#14171b';
const BAR_COLOR: Record<string, string | undefined> = {
  red: '#ff4b3e', redYellow: '#ff8f2e', yellow: '#ffc933', green: '#19c37d',
};
const BAR_M = 0.35;
const LONGEST_BAR_M = 15;
const LAMP_M = 0.32;
const LAMP_REM = [0.17, 0.7];
const HIDDEN_BELOW = 1.2;

/** The lights of the scene and their states. */
export class SignalLayer {
  #lights: (Light & { ends: number[][] })[] = [];

  load(scene: Scene) {
    const lanelets = new Map(scene.lanelets.map((lanelet) => [lanelet.id, lanelet]));
    this.#lights = scene.lights.map((light) => ({
      ...light, ends: light.lanelets.map((id) => lanelets.get(id))
        .filter((lanelet) => lanelet !== undefined)
        .map(({ left, right }) => [...left.slice(-2), ...right.slice(-2)]),
    }));
  }

  /** Draw the bars on the road, under the vehicles. */
  drawBars(context: CanvasRenderingContext2D, { camera, ratio, store }: View) {
    context.lineWidth = Math.max(BAR_M, 2 / camera.scale);
    for (const light of this.#lights) {
      const color = BAR_COLOR[store.signals.states[light.id]];
      if (color === undefined) {
        continue;
      }
      context.strokeStyle = color;
      for (const [x0, y0, x1, y1] of light.ends) {
        if (camera.sees(x0, y0, LONGEST_BAR_M)) {
          camera.enterMap(context, ratio, x0, y0);
          context.beginPath();
          context.moveTo(0, 0);
          context.lineTo(x1 - x0, y1 - y0);
          context.stroke();
        }
      }
    }
  }

  /** Draw the housings, over everything on the road. */
  drawLamps(context: CanvasRenderingContext2D, { camera, palette, ratio, store }: View) {
    if (camera.scale < HIDDEN_BELOW) {
      return;
    }
    const radius = Math.min(Math.max(LAMP_M * camera.scale, LAMP_REM[0] * palette.rem_px),
      LAMP_REM[1] * palette.rem_px);
    for (const light of this.#lights) {
      if (!camera.sees(light.x, light.y, 0)) {
        continue;
      }
      const lit = LIT[store.signals.states[light.id]];
      context.setTransform(ratio, 0, 0, ratio,
        ratio * camera.toX(light.x, light.y), ratio * camera.toY(light.x, light.y));
      context.fillStyle = HOUSING;
      context.strokeStyle = palette.kerb;
      context.lineWidth = 1;
      context.beginPath();
      context.roundRect(-1.5 * radius, -4.1 * radius, 3 * radius, 8.2 * radius, radius);
      context.fill();
      context.stroke();
      for (let i = 0; i < LAMPS.length; i += 1) {
        context.fillStyle = lit?.includes(LAMPS[i][0]) ? LAMPS[i][1] : OFF;
        context.beginPath();
        context.arc(0, (i - 1) * 2.5 * radius, radius, 0, 2 * Math.PI);
        context.fill();
      }
    }
  }
}
