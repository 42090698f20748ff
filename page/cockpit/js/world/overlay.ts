// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** North arrow and scale bar in the upper right corner of the canvas. */

import type { Camera } from './camera.js';
import type { View } from './painter.js';
import type { Colors } from './palette.js';

const LONGEST_BAR_REM = 6.5;
// On a narrower canvas, such as the small map, they would cover the content.
const NARROW_REM = 21;
const lengths = [0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000, 20000];
const texts = lengths.map((length) => (length < 1000 ? `${length} m` : `${length / 1000} km`));

/** Draw both if there is room; `view`: camera, palette and ratio. */
export function drawOverlay(context: CanvasRenderingContext2D,
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
