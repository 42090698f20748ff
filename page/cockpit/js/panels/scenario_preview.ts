// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A small drawing of a scenario at its beginning. */

import { boxOf, outlineOf } from '../outline.js';
import { colorNameOf, onThemeChange, themeColor } from '../world/palette.js';
import { addLine, addPolygon } from '../world/polyline.js';

import type { Preview } from '../api_messages.js';
import type { Box, Scene, Shape } from '../messages.js';

const MARGIN_PX = 8;
// Least drawn size, so that vehicles are visible on a long road [px].
const SMALLEST_PX = 7;
// From this size of a car on, one drawing shows the whole map [m, px].
const CAR_M = 4.5;
const CAR_PX = 6;
const LANE_M = 3;
const LANE_PX = 4;
// Else: margin around the vehicles [m], and the overview's share of the height.
const AROUND_M = 30;
const OVERVIEW = 0.25;

export interface Area { x: number; y: number; width: number; height: number } // of the canvas [px]

export interface Body {
  shape: Shape;
  pose: number[]; // x, y [m], yaw [rad]
  ahead: number; // from there to the centre [m]
  fill: string;
  scale: number; // [px/m]
  edge?: string | null;
}

/** A drawing on a canvas, for any size and theme. */
export class ScenarioPreview {
  #canvas;
  #preview: Preview | null = null;

  /** @param canvas its size is that of its box */
  constructor(canvas: HTMLCanvasElement) {
    this.#canvas = canvas;
    new ResizeObserver(() => this.#draw()).observe(canvas);
    onThemeChange(() => this.#draw());
  }

  /** @param preview answer of /api/preview */
  show(preview: Preview | null) {
    this.#preview = preview;
    this.#draw();
  }

  #draw() {
    const canvas = this.#canvas;
    const box = canvas.getBoundingClientRect();
    if (box.width === 0) {
      return;
    }
    canvas.width = Math.round(box.width * window.devicePixelRatio);
    canvas.height = Math.round(box.height * window.devicePixelRatio);
    if (this.#preview === null) {
      return;
    }
    const context = canvas.getContext('2d') as CanvasRenderingContext2D;
    const whole = this.#preview.scene.bounds;
    const all = { x: 0, y: 0, width: canvas.width, height: canvas.height };
    if (scaleOf(all, whole) * CAR_M >= CAR_PX * window.devicePixelRatio) {
      drawScene(context, this.#preview, all, whole);
      return;
    }
    // A car would be a dot: the surroundings of the vehicles, and below them the whole map.
    const overview = { ...all, height: Math.round(OVERVIEW * all.height) };
    overview.y = all.height - overview.height;
    const detail = { ...all, height: overview.y };
    const around = surroundings(this.#preview, detail);
    drawScene(context, this.#preview, detail, around);
    drawScene(context, this.#preview, overview, whole);
    drawMarks(context, overview, whole, around);
  }
}

function drawScene(context: CanvasRenderingContext2D, { scene, states }: Preview, area: Area,
  bounds: Box) {
  context.save();
  context.beginPath();
  context.rect(area.x, area.y, area.width, area.height);
  context.clip();
  const scale = fit(context, area, bounds);
  drawRoads(context, scene, scale);
  scene.objects.forEach((object, i) => drawBody(context, {
    shape: object.shape, pose: pose(states.objects, i), ahead: 0,
    fill: themeColor(colorNameOf(object)), scale,
  }));
  scene.vehicles.forEach((vehicle, i) => drawBody(context, {
    shape: vehicle.shape, pose: pose(states.vehicles, i),
    ahead: vehicle.rear_to_center, scale, edge: themeColor('map-outline'),
    fill: themeColor(colorNameOf(vehicle)),
  }));
  context.restore();
}

/** A box around all driven vehicles, of the shape of its area. */
function surroundings({ scene, states }: Preview, area: Area): Box {
  const poses = scene.vehicles.map((_, i) => pose(states.vehicles, i));
  if (poses.length === 0) {
    return scene.bounds;
  }
  const [left, bottom, right, top] = boxOf(poses.flatMap(([x, y]) => [x, y]));
  const half = 0.5 * Math.max(right - left, (top - bottom) * area.width / area.height)
    + AROUND_M;
  const tall = half * area.height / area.width;
  const [x, y] = [0.5 * (left + right), 0.5 * (bottom + top)];
  return [x - half, y - tall, x + half, y + tall];
}

/** A line between the two drawings, and in the overview a frame around what the other shows. */
function drawMarks(context: CanvasRenderingContext2D, overview: Area, whole: Box, around: Box) {
  context.save();
  context.strokeStyle = themeColor('border');
  context.lineWidth = window.devicePixelRatio;
  context.strokeRect(-1, overview.y, overview.width + 2, overview.height + 2);
  const scale = fit(context, overview, whole);
  const smallest = SMALLEST_PX * window.devicePixelRatio / scale;
  const tall = Math.max(around[3] - around[1], smallest);
  context.strokeStyle = themeColor('accent');
  context.lineWidth = 1.5 * window.devicePixelRatio / scale;
  context.strokeRect(around[0], 0.5 * (around[1] + around[3] - tall), around[2] - around[0], tall);
  context.restore();
}

/**
 * @param rows of vehicles or objects
 * @param index of one of them
 * @returns x, y [m], yaw [rad]; NaN if there is none
 */
function pose(rows: (number | null)[][], index: number): number[] {
  return (rows[index] ?? []).slice(0, 3).map((value) => value ?? NaN);
}

function scaleOf(area: Area, [left, bottom, right, top]: Box) {
  const margin = MARGIN_PX * window.devicePixelRatio;
  return Math.min((area.width - 2 * margin) / Math.max(right - left, 1),
    (area.height - 2 * margin) / Math.max(top - bottom, 1));
}

function fit(context: CanvasRenderingContext2D, area: Area, bounds: Box) {
  const [left, bottom, right, top] = bounds;
  const scale = scaleOf(area, bounds);
  context.setTransform(scale, 0, 0, -scale,
    area.x + 0.5 * area.width - 0.5 * scale * (left + right),
    area.y + 0.5 * area.height + 0.5 * scale * (bottom + top));
  return scale;
}

function drawRoads(context: CanvasRenderingContext2D, scene: Scene, scale: number) {
  const pixel = window.devicePixelRatio / scale;
  context.lineWidth = pixel;
  context.fillStyle = themeColor('map-road');
  // If lanes are thinner than their lines, the road is drawn as one line.
  const isThin = LANE_M * scale < LANE_PX * window.devicePixelRatio;
  context.strokeStyle = themeColor(isThin ? 'map-road' : 'map-mark');
  for (const lanelet of scene.lanelets) {
    context.beginPath();
    addPolygon(context, outlineOf(lanelet), 0, 0);
    context.fill();
  }
  for (const lanelet of scene.lanelets) {
    context.beginPath();
    addLine(context, lanelet.left, 0, 0);
    addLine(context, lanelet.right, 0, 0);
    context.stroke();
  }
  context.fillStyle = themeColor('av');
  context.globalAlpha = 0.25;
  for (const polygon of scene.goals.flatMap((goal) => goal.polygons)) {
    context.beginPath();
    addPolygon(context, polygon, 0, 0);
    context.fill();
  }
  context.globalAlpha = 1;
}

function drawBody(context: CanvasRenderingContext2D,
  { shape, pose: [x, y, yaw], ahead, fill, scale, edge = null }: Body) {
  if (!Number.isFinite(x + y + yaw)) {
    return;
  }
  context.save();
  context.translate(x, y);
  context.rotate(yaw);
  context.translate(ahead, 0);
  const smallest = SMALLEST_PX * window.devicePixelRatio / scale;
  const grow = Math.max(1, smallest / Math.max(shape.length, shape.width));
  context.scale(grow, grow);
  context.beginPath();
  if (shape.kind === 'polygon' && shape.vertices.length > 0) {
    addPolygon(context, shape.vertices, 0, 0);
  } else if (shape.kind === 'circle') {
    context.arc(0, 0, 0.5 * shape.length, 0, 2 * Math.PI);
  } else {
    context.rect(-0.5 * shape.length, -0.5 * shape.width, shape.length, shape.width);
  }
  context.fillStyle = fill;
  context.fill();
  if (edge) {
    context.lineWidth = window.devicePixelRatio / scale / grow;
    context.strokeStyle = edge;
    context.stroke();
  }
  context.restore();
}
