// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Ground, roads and their markings, stop lines, and the AVs' goals. */

import { boxOf } from '../outline.js';
import { buildChunks, SURFACES } from './map_geometry.js';
import { addLine, addPolygon } from './polyline.js';

import type { Box, Scene } from '../messages.js';
import type { Chunk } from './map_geometry.js';
import type { View } from './painter.js';

// Line widths [m], and the least that they are drawn with [CSS px].
const WIDTH = {
  lines: 0.13, broad: 0.28, curbs: 0.16, seams: 0.08, stop: 0.4, casing: 0.45, slit: 0.06,
};
const LEAST_PX = 0.9;
// Scales [px/m] from which details appear, and at which they are fully shown.
const MARKS = [0.6, 2.2];
const ARROWS = [2.2, 5];
const KERBS = [0.8, 2.5];
// Least width of a road on the screen [px].
const ROAD_PX = 1.5;
const GRID_PX = 90;
const GOAL_DASH = [1.2, 0.8];

export interface Local { x: number; y: number; box: Box; path: Path2D } // a path around (x, y)

/** The part of the world that does not change during a run. */
export class MapLayer {
  #chunks: Chunk[] = [];
  #visible: Chunk[] = [];
  #gaps: Local[] = [];
  #stops: Local[] = [];
  #goals: Local[] = [];

  /** Whether the AVs' goals are shown. */
  goals = true;

  load(scene: Scene) {
    this.#chunks = buildChunks(scene);
    this.#stops = scene.stop_lines.map(({ points }) => local(points, addLine));
    this.#gaps = (scene.gaps ?? []).map((gap) => local(gap, addPolygon));
    this.#goals = scene.goals.flatMap(({ polygons }) =>
      polygons.map((polygon) => local(polygon, addPolygon)));
  }

  /** Draw everything that lies under vehicles and plans. */
  draw(context: CanvasRenderingContext2D, view: View) {
    this.#drawGround(context, view);
    this.#visible.length = 0;
    for (const chunk of this.#chunks) {
      if (view.camera.seesBox(chunk.box)) {
        this.#visible.push(chunk);
      }
    }
    this.#drawSurfaces(context, view);
    if (this.goals && view.insight) {
      this.#drawGoals(context, view);
    }
    this.#drawMarks(context, view);
  }

  /** Draw a faint grid, which shows motion where there is no road. */
  #drawGround(context: CanvasRenderingContext2D, { camera, palette, ratio }: View) {
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = palette.ground;
    context.fillRect(0, 0, camera.width, camera.height);
    const spacing = roundStep(GRID_PX / camera.scale);
    const ox = Math.round(camera.x / spacing) * spacing;
    const oy = Math.round(camera.y / spacing) * spacing;
    camera.enterMap(context, ratio, ox, oy);
    context.strokeStyle = palette.grid;
    context.lineWidth = 1 / camera.scale;
    context.beginPath();
    for (let x = Math.floor((camera.left - ox) / spacing) * spacing;
      x <= camera.right - ox; x += spacing) {
      context.moveTo(x, camera.bottom - oy);
      context.lineTo(x, camera.top - oy);
    }
    for (let y = Math.floor((camera.bottom - oy) / spacing) * spacing;
      y <= camera.top - oy; y += spacing) {
      context.moveTo(camera.left - ox, y);
      context.lineTo(camera.right - ox, y);
    }
    context.stroke();
  }

  /** Draw edges first and all surfaces over them, so that the outer edge of the road remains. */
  #drawSurfaces(context: CanvasRenderingContext2D, { camera, palette, ratio }: View) {
    context.lineJoin = 'round';
    const kerbs = faded(camera.scale, KERBS);
    if (kerbs > 0) {
      context.globalAlpha = kerbs;
      context.strokeStyle = palette.kerb;
      context.lineWidth = Math.max(WIDTH.casing, 2 / camera.scale);
      for (const chunk of this.#visible) {
        camera.enterMap(context, ratio, chunk.x, chunk.y);
        context.stroke(chunk.casing);
      }
      context.globalAlpha = 1;
    }
    context.fillStyle = palette.junction;
    context.strokeStyle = palette.junction;
    for (const gap of this.#gaps) {
      if (camera.seesBox(gap.box)) {
        camera.enterMap(context, ratio, gap.x, gap.y);
        context.fill(gap.path);
        context.stroke(gap.path);
      }
    }
    // A thin stroke closes slits of a few centimetres between neighbours.
    context.lineWidth = Math.max(WIDTH.slit, (1 - kerbs) * ROAD_PX / camera.scale);
    for (const surface of SURFACES) {
      context.fillStyle = palette[surface];
      context.strokeStyle = palette[surface];
      for (const chunk of this.#visible) {
        const path = chunk.surfaces.get(surface);
        if (path !== undefined) {
          camera.enterMap(context, ratio, chunk.x, chunk.y);
          context.fill(path);
          context.stroke(path);
        }
      }
    }
  }

  #drawMarks(context: CanvasRenderingContext2D, view: View) {
    const { camera, palette } = view;
    const marks = faded(camera.scale, MARKS);
    if (marks > 0) {
      this.#strokeAll(context, view, 'seams', palette.seam, marks);
      this.#strokeAll(context, view, 'curbs', palette.kerb, marks);
      this.#strokeAll(context, view, 'lines', palette.mark, marks);
      this.#strokeAll(context, view, 'broad', palette.mark, marks);
      this.#fillAll(context, view, 'zebras', palette.mark, marks);
    }
    const arrows = faded(camera.scale, ARROWS);
    if (arrows > 0) {
      this.#fillAll(context, view, 'arrows', palette.arrow, arrows);
    }
    context.globalAlpha = 1;
    context.strokeStyle = palette.stop;
    context.lineCap = 'butt';
    context.lineWidth = Math.max(WIDTH.stop, 1 / camera.scale);
    for (const stop of this.#stops) {
      if (camera.seesBox(stop.box)) {
        camera.enterMap(context, view.ratio, stop.x, stop.y);
        context.stroke(stop.path);
      }
    }
  }

  #strokeAll(context: CanvasRenderingContext2D, { camera, ratio }: View,
    name: 'seams' | 'curbs' | 'lines' | 'broad', color: string, alpha: number) {
    context.globalAlpha = alpha;
    context.strokeStyle = color;
    context.lineWidth = Math.max(WIDTH[name], LEAST_PX / camera.scale);
    for (const chunk of this.#visible) {
      camera.enterMap(context, ratio, chunk.x, chunk.y);
      context.stroke(chunk[name]);
    }
  }

  #fillAll(context: CanvasRenderingContext2D, { camera, ratio }: View, name: 'zebras' | 'arrows',
    color: string, alpha: number) {
    context.globalAlpha = alpha;
    context.fillStyle = color;
    for (const chunk of this.#visible) {
      camera.enterMap(context, ratio, chunk.x, chunk.y);
      context.fill(chunk[name]);
    }
  }

  #drawGoals(context: CanvasRenderingContext2D, { camera, palette, ratio }: View) {
    context.fillStyle = palette.av;
    context.strokeStyle = palette.av;
    for (const goal of this.#goals) {
      if (camera.seesBox(goal.box)) {
        camera.enterMap(context, ratio, goal.x, goal.y);
        context.globalAlpha = 0.09;
        context.fill(goal.path);
        context.globalAlpha = 0.65;
        context.lineWidth = Math.max(0.15, 1.2 / camera.scale);
        context.setLineDash(GOAL_DASH);
        context.stroke(goal.path);
      }
    }
    context.setLineDash(NO_DASH);
    context.globalAlpha = 1;
  }
}

const NO_DASH: number[] = [];

/** Return a path relative to the middle of its points. */
function local(points: number[], add: typeof addPolygon): Local {
  const box = boxOf(points);
  const x = (box[0] + box[2]) / 2;
  const y = (box[1] + box[3]) / 2;
  const path = new Path2D();
  add(path, points, x, y);
  return { x, y, box, path };
}

function faded(scale: number, [from, to]: number[]) {
  return Math.min(Math.max((scale - from) / (to - from), 0), 1);
}

/**
 * Round a length up to 1, 2 or 5 times a power of ten.
 * @param length any positive length
 * @returns the rounded one
 */
export function roundStep(length: number): number {
  const power = 10 ** Math.floor(Math.log10(length));
  const lead = length / power;
  return power * (lead <= 1 ? 1 : lead <= 2 ? 2 : lead <= 5 ? 5 : 10);
}
