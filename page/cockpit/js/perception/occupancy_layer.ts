// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The layer of permanent obstacles: occupied cells, drawn so that thin walls stay visible. */

import type { OccupancyFrame } from '../frames.js';
import type { View } from '../world/painter.js';

// Cells smaller than this on the screen are merged by fours, repeatedly [px].
const LEAST_PX = 0.75;
const COARSEST = 6;

/** Of detail. */
export interface Level {
  coarseness: number; // its cells are 2 to the power of this as long as the map's
  rows: number;
  columns: number;
  cells: Uint8Array;
  picture: HTMLCanvasElement | null;
}

/** The layer that draws the store's map as a picture in the theme's colour. */
export class OccupancyLayer {
  /** Number of occupied cells in the map that was drawn last. */
  drawn = 0;
  #map: OccupancyFrame | null = null;
  #color = '';
  #levels: Level[] = [];

  /** Draw the map; `view` as layers get it. */
  draw(context: CanvasRenderingContext2D, { camera, palette, ratio, store }: View) {
    const map = store.perceived.occupancy;
    if (map === null) {
      this.drawn = 0;
      return;
    }
    if (map !== this.#map) {
      this.#map = map;
      const first = firstLevel(map);
      this.#levels = [first];
      this.drawn = first.cells.reduce((sum, cell) => sum + cell, 0);
    }
    if (palette.occupied !== this.#color) {
      this.#color = palette.occupied;
      this.#levels.forEach((level) => { level.picture = null; });
    }
    if (this.drawn === 0) {
      return;
    }
    const level = this.#level(map.resolution * camera.scale * ratio);
    const edge = map.resolution * 2 ** level.coarseness;
    level.picture ??= paint(level, this.#color);
    camera.enterMap(context, ratio, map.x, map.y);
    context.imageSmoothingEnabled = false;
    context.drawImage(level.picture, 0, 0, level.columns * edge, level.rows * edge);
  }

  /** Return the finest level whose cells are large enough on the screen. */
  #level(cell_px: number): Level {
    let wanted = 0;
    while (wanted < COARSEST && cell_px * 2 ** wanted < LEAST_PX) {
      wanted += 1;
    }
    while (this.#levels.length <= wanted) {
      this.#levels.push(coarser(this.#levels[this.#levels.length - 1]));
    }
    return this.#levels[wanted];
  }
}

function firstLevel({ rows, columns, bits }: OccupancyFrame): Level {
  const cells = new Uint8Array(rows * columns);
  for (let i = 0; i < cells.length; i += 1) {
    cells[i] = bits[i >> 3] >> (i & 7) & 1;
  }
  return { coarseness: 0, rows, columns, cells, picture: null };
}

/** Merge four cells into one, which is occupied if any of them is, so that no wall gets lost. */
function coarser({ coarseness, rows, columns, cells }: Level): Level {
  const height = Math.ceil(rows / 2);
  const width = Math.ceil(columns / 2);
  const joined = new Uint8Array(height * width);
  for (let row = 0; row < rows; row += 1) {
    const into = (row >> 1) * width;
    for (let column = 0; column < columns; column += 1) {
      joined[into + (column >> 1)] |= cells[row * columns + column];
    }
  }
  return {
    coarseness: coarseness + 1, rows: height, columns: width, cells: joined, picture: null,
  };
}

function paint({ rows, columns, cells }: Level, color: string) {
  const canvas = document.createElement('canvas');
  canvas.width = columns;
  canvas.height = rows;
  const context = canvas.getContext('2d') as CanvasRenderingContext2D;
  const image = context.createImageData(columns, rows);
  for (let i = 0; i < cells.length; i += 1) {
    image.data[4 * i + 3] = 255 * cells[i];
  }
  context.putImageData(image, 0, 0);
  context.globalCompositeOperation = 'source-in';
  context.fillStyle = color;
  context.fillRect(0, 0, columns, rows);
  return canvas;
}
