// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The symbols on signs, drawn in a square from -1 to 1 with y down. */

import { addLine } from '../../world/polyline.js';

export type Context = CanvasRenderingContext2D;

function fill(context: Context, points: number[]) {
  context.beginPath();
  addLine(context, points, 0, 0);
  context.fill();
}

function stroke(context: Context, width: number, ...points: number[]) {
  context.lineWidth = width;
  context.beginPath();
  addLine(context, points, 0, 0);
  context.stroke();
}

function dot(context: Context, x: number, y: number, radius: number) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fill();
}

/** Draw an upward arrow, turned by some quarter turns to the right. */
function arrow(context: Context, quarters: number) {
  context.save();
  context.rotate(quarters * Math.PI / 2);
  fill(context, [-0.13, 0.8, -0.13, -0.1, -0.5, -0.1, 0, -0.8, 0.5, -0.1, 0.13, -0.1, 0.13, 0.8]);
  context.restore();
}

/** Draw an arrow that leads up, then to a side. */
function turning(context: Context, side: number) {
  stroke(context, 0.26, -0.3 * side, 0.8, -0.3 * side, -0.1, 0.2 * side, -0.1);
  fill(context, [0.1 * side, -0.55, 0.75 * side, -0.1, 0.1 * side, 0.35]);
}

function vehicle(context: Context, x: number, color: string, size: number) {
  context.save();
  context.fillStyle = color;
  context.translate(x, 0);
  context.scale(size, size);
  fill(context, [-0.42, 0.3, -0.42, -0.02, -0.28, -0.08, -0.2, -0.36, 0.2, -0.36, 0.28, -0.08,
    0.42, -0.02, 0.42, 0.3]);
  fill(context, [-0.36, 0.44, -0.36, 0.28, -0.2, 0.28, -0.2, 0.44]);
  fill(context, [0.36, 0.44, 0.36, 0.28, 0.2, 0.28, 0.2, 0.44]);
  context.restore();
}

function lorry(context: Context, x: number, color: string) {
  context.save();
  context.fillStyle = color;
  fill(context, [x - 0.36, 0.36, x - 0.36, -0.5, x + 0.36, -0.5, x + 0.36, 0.36]);
  fill(context, [x - 0.3, 0.52, x - 0.3, 0.3, x - 0.14, 0.3, x - 0.14, 0.52]);
  fill(context, [x + 0.3, 0.52, x + 0.3, 0.3, x + 0.14, 0.3, x + 0.14, 0.52]);
  context.restore();
}

function curve(context: Context, side: number) {
  context.lineWidth = 0.2;
  context.beginPath();
  context.moveTo(-0.25 * side, 0.75);
  context.bezierCurveTo(-0.25 * side, 0.1, 0.25 * side, 0.2, 0.25 * side, -0.35);
  context.stroke();
  fill(context, [0.25 * side - 0.28, -0.3, 0.25 * side, -0.75, 0.25 * side + 0.28, -0.3]);
}

export const SYMBOLS: Record<string, (context: Context) => void> = {
  up: (c) => arrow(c, 0),
  'across-right': (c) => arrow(c, 1),
  'across-left': (c) => arrow(c, -1),
  'down-right': (c) => arrow(c, 1.5),
  'down-left': (c) => arrow(c, -1.5),
  right: (c) => turning(c, 1),
  left: (c) => turning(c, -1),
  'u-turn': (c) => {
    c.lineWidth = 0.22;
    c.beginPath();
    c.moveTo(0.35, 0.7);
    c.lineTo(0.35, -0.1);
    c.arc(0, -0.15, 0.35, 0, -Math.PI, true);
    c.lineTo(-0.35, 0.2);
    c.stroke();
    fill(c, [-0.7, 0.1, -0.35, 0.6, 0, 0.1]);
  },
  roundabout: (c) => {
    c.lineWidth = 0.2;
    for (let k = 0; k < 3; k += 1) {
      c.save();
      c.rotate(2 * Math.PI * k / 3);
      c.beginPath();
      c.arc(0, 0, 0.52, -0.35, -1.75, true);
      c.stroke();
      c.rotate(-1.85);
      fill(c, [0.2, 0.12, 0.84, 0.12, 0.52, -0.36]);
      c.restore();
    }
  },
  overtaking: (c) => {
    vehicle(c, -0.38, '#c8102e', 0.8);
    vehicle(c, 0.38, c.fillStyle.toString(), 0.8);
  },
  'overtaking-truck': (c) => {
    lorry(c, -0.4, '#c8102e');
    vehicle(c, 0.38, c.fillStyle.toString(), 0.8);
  },
  car: (c) => vehicle(c, 0, c.fillStyle.toString(), 1.3),
  truck: (c) => lorry(c, 0, c.fillStyle.toString()),
  bicycle: (c) => {
    c.lineWidth = 0.1;
    for (const x of [-0.45, 0.45]) {
      c.beginPath();
      c.arc(x, 0.25, 0.32, 0, 2 * Math.PI);
      c.stroke();
    }
    stroke(c, 0.1, -0.45, 0.25, -0.2, -0.25, 0.3, -0.25, 0, 0.25, -0.25, -0.35);
    stroke(c, 0.1, 0.45, 0.25, 0.25, -0.45, 0.45, -0.5);
  },
  walker: (c) => {
    dot(c, 0.05, -0.68, 0.16);
    stroke(c, 0.22, 0.02, -0.45, 0, 0.15);
    stroke(c, 0.14, 0, 0.1, -0.3, 0.8);
    stroke(c, 0.14, 0, 0.1, 0.25, 0.42, 0.32, 0.8);
    stroke(c, 0.11, 0.03, -0.42, -0.32, -0.05);
    stroke(c, 0.11, 0.03, -0.42, 0.36, -0.02);
  },
  danger: (c) => {
    fill(c, [-0.16, -0.8, 0.16, -0.8, 0.08, 0.28, -0.08, 0.28]);
    dot(c, 0, 0.58, 0.15);
  },
  cross: (c) => {
    stroke(c, 0.24, -0.5, -0.5, 0.5, 0.6);
    stroke(c, 0.24, 0.5, -0.5, -0.5, 0.6);
  },
  'right-of-way': (c) => {
    stroke(c, 0.28, 0, 0.75, 0, -0.3);
    fill(c, [-0.32, -0.2, 0, -0.8, 0.32, -0.2]);
    stroke(c, 0.14, -0.55, 0.2, 0.55, 0.2);
  },
  'curve-left': (c) => curve(c, -1),
  'curve-right': (c) => curve(c, 1),
  lights: (c) => {
    [['#d8232a', -0.45], ['#f2b200', 0.08], ['#0a9a4a', 0.6]].forEach(([color, y]) => {
      c.fillStyle = String(color);
      dot(c, 0, Number(y), 0.23);
    });
  },
  'two-way': (c) => {
    stroke(c, 0.16, -0.28, -0.1, -0.28, 0.7);
    fill(c, [-0.52, -0.05, -0.28, -0.55, -0.04, -0.05]);
    stroke(c, 0.16, 0.28, -0.5, 0.28, 0.3);
    fill(c, [0.52, 0.25, 0.28, 0.75, 0.04, 0.25]);
  },
  works: (c) => {
    dot(c, -0.1, -0.55, 0.15);
    stroke(c, 0.2, -0.12, -0.38, -0.05, 0.15);
    stroke(c, 0.13, -0.05, 0.15, -0.35, 0.7);
    stroke(c, 0.13, -0.05, 0.15, 0.2, 0.7);
    stroke(c, 0.1, -0.1, -0.25, 0.45, 0.3);
    fill(c, [0.3, 0.7, 0.55, 0.25, 0.85, 0.7]);
  },
  bar: (c) => fill(c, [-0.72, -0.17, 0.72, -0.17, 0.72, 0.17, -0.72, 0.17]),
  first: (c) => {
    stroke(c, 0.2, 0.35, 0.75, 0.35, -0.3);
    fill(c, [0.05, -0.2, 0.35, -0.75, 0.65, -0.2]);
    c.fillStyle = '#d8232a';
    fill(c, [-0.45, -0.6, -0.25, -0.6, -0.25, 0.25, -0.12, 0.25, -0.35, 0.7, -0.58, 0.25,
      -0.45, 0.25]);
  },
  second: (c) => {
    stroke(c, 0.18, -0.3, -0.6, -0.3, 0.25);
    fill(c, [-0.55, 0.2, -0.3, 0.65, -0.05, 0.2]);
    c.fillStyle = '#d8232a';
    fill(c, [0.22, 0.6, 0.22, -0.2, 0.08, -0.2, 0.32, -0.62, 0.56, -0.2, 0.42, -0.2, 0.42, 0.6]);
  },
  'no-stopping': (c) => {
    stroke(c, 0.2, -0.62, -0.62, 0.62, 0.62);
    stroke(c, 0.2, 0.62, -0.62, -0.62, 0.62);
  },
  'no-parking': (c) => stroke(c, 0.2, -0.62, -0.62, 0.62, 0.62),
  motorway: (c) => {
    stroke(c, 0.14, -0.5, 0.75, -0.16, -0.7);
    stroke(c, 0.14, 0.5, 0.75, 0.16, -0.7);
    stroke(c, 0.16, -0.62, -0.25, 0.62, -0.25);
    stroke(c, 0.1, 0, 0.75, 0, 0.1);
  },
  'motorway-end': (c) => {
    SYMBOLS.motorway(c);
    c.strokeStyle = '#d8232a';
    stroke(c, 0.14, -0.85, 0.85, 0.85, -0.85);
  },
  'dead-end': (c) => {
    stroke(c, 0.3, 0, 0.8, 0, -0.3);
    c.fillStyle = '#d8232a';
    fill(c, [-0.5, -0.55, 0.5, -0.55, 0.5, -0.25, -0.5, -0.25]);
  },
  tunnel: (c) => {
    c.beginPath();
    c.moveTo(-0.55, 0.7);
    c.arc(0, -0.05, 0.55, Math.PI, 0);
    c.lineTo(0.55, 0.7);
    c.fill();
  },
};
