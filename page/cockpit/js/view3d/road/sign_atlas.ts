// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** An atlas of all plates of a scene on one canvas, for one texture. */

import { SYMBOLS } from './sign_symbols.js';

import type { Face, PlateShape } from './sign_faces.js';

export type Context = CanvasRenderingContext2D;
export type Cell = [left: number, top: number, right: number, bottom: number]; // 0 to 1

const CELL_PX = 128;
const COLUMNS = 8;
const ROWS = 8;
const MARGIN = 0.06;
const LINE_LETTERS = 14;
const RED = '#c8102e';
const BLUE = '#15539e';
const BLACK = '#17191c';
const WHITE = '#f6f6f2';
const BACK = '#7d8287';
const FONT = 'Arial, Helvetica, "Liberation Sans", sans-serif';

const STYLES: Record<Face['style'], { field: string; ink: string }> = {
  prohibit: { field: WHITE, ink: BLACK }, end: { field: WHITE, ink: '#8d8f92' },
  order: { field: BLUE, ink: WHITE }, warn: { field: WHITE, ink: BLACK },
  stop: { field: RED, ink: WHITE }, yield: { field: WHITE, ink: BLACK },
  priority: { field: WHITE, ink: BLACK }, blue: { field: BLUE, ink: WHITE },
  white: { field: WHITE, ink: BLACK }, yellow: { field: '#f4c300', ink: BLACK },
  green: { field: '#f4c300', ink: '#0d6b3c' }, red: { field: RED, ink: WHITE },
};

/** Corners from -1 to 1 with y down; none of a circle. */
const OUTLINES: Record<PlateShape, number[]> = {
  circle: [], triangle: [0, -0.87, 1, 0.87, -1, 0.87], yield: [0, 0.87, -1, -0.87, 1, -0.87],
  octagon: [-0.41, -1, 0.41, -1, 1, -0.41, 1, 0.41, 0.41, 1, -0.41, 1, -1, 0.41, -1, -0.41],
  diamond: [0, -1, 1, 0, 0, 1, -1, 0], square: [-1, -1, 1, -1, 1, 1, -1, 1],
  wide: [-1, -0.5, 1, -0.5, 1, 0.5, -1, 0.5], tall: [-0.8, -1, 0.8, -1, 0.8, 1, -0.8, 1],
};

/** An atlas that draws each face once. */
export class SignAtlas {
  canvas = document.createElement('canvas');
  #cells = new Map<string, Cell>();

  constructor() {
    this.canvas.width = CELL_PX * COLUMNS;
    this.canvas.height = CELL_PX * ROWS;
  }

  cellOf(face: Face): Cell {
    return this.#cell(JSON.stringify(face), (context) => drawFace(context, face));
  }

  /** Return the place of a plate's grey back. */
  backOf(shape: PlateShape): Cell {
    return this.#cell(shape, (context) => {
      context.fillStyle = BACK;
      outline(context, shape, 1);
      context.fill();
    });
  }

  #cell(key: string, draw: (context: Context) => void): Cell {
    const known = this.#cells.get(key);
    if (known !== undefined) {
      return known;
    }
    // If a map has more plates than cells, the rest share the last cell.
    const at = Math.min(this.#cells.size, COLUMNS * ROWS - 1);
    const [column, row] = [at % COLUMNS, Math.floor(at / COLUMNS)];
    const context = this.canvas.getContext('2d') as Context;
    context.save();
    context.clearRect(column * CELL_PX, row * CELL_PX, CELL_PX, CELL_PX);
    context.translate((column + 0.5) * CELL_PX, (row + 0.5) * CELL_PX);
    context.scale(CELL_PX / 2 * (1 - MARGIN), CELL_PX / 2 * (1 - MARGIN));
    context.lineJoin = 'round';
    draw(context);
    context.restore();
    const cell: Cell = [column / COLUMNS, row / ROWS, (column + 1) / COLUMNS, (row + 1) / ROWS];
    this.#cells.set(key, cell);
    return cell;
  }
}

function outline(context: Context, shape: PlateShape, size: number) {
  context.beginPath();
  if (shape === 'circle') {
    context.arc(0, 0, size, 0, 2 * Math.PI);
  } else {
    const corners = OUTLINES[shape];
    // Triangles shrink towards their centroid, a third above their base.
    const middle = shape === 'triangle' ? 0.29 : shape === 'yield' ? -0.29 : 0;
    for (let i = 0; i < corners.length; i += 2) {
      context.lineTo(size * corners[i], middle + size * (corners[i + 1] - middle));
    }
  }
  context.closePath();
}

function drawFace(context: Context, face: Face) {
  const { field, ink } = STYLES[face.style];
  const layer = (color: string, size: number) => {
    context.fillStyle = color;
    outline(context, face.shape, size);
    context.fill();
  };
  layer(WHITE, 1);
  switch (face.style) {
    case 'prohibit': layer(RED, 0.97); layer(field, 0.74); break;
    case 'warn':
    case 'yield': layer(RED, 0.97); layer(field, 0.66); break;
    case 'priority': layer(BLACK, 0.96); layer(WHITE, 0.92); layer('#f4b400', 0.68); break;
    case 'green': layer(ink, 0.97); layer(field, 0.82); break;
    case 'white':
    case 'yellow': layer(BLACK, 0.97); layer(field, face.shape === 'wide' ? 0.92 : 0.93); break;
    case 'end': layer(BLACK, 0.97); layer(field, 0.94); break;
    default: layer(field, 0.94);
  }
  context.fillStyle = ink;
  context.strokeStyle = ink;
  drawContent(context, face);
  if (face.style === 'end') {
    context.strokeStyle = BLACK;
    context.lineWidth = 0.045;
    for (const aside of [-0.2, -0.1, 0, 0.1, 0.2]) {
      context.beginPath();
      context.moveTo(-0.62 + aside, 0.62 + aside);
      context.lineTo(0.62 + aside, -0.62 + aside);
      context.stroke();
    }
  }
}

function drawContent(context: Context, { shape, style, symbol, text }: Face) {
  if (symbol === 'zone' || symbol === 'zone-end') {
    zone(context, text, symbol === 'zone-end');
  } else if (symbol === 'limit') {
    words(context, 'SPEED LIMIT', -0.62, 1.3, 0.34);
    words(context, text, 0.12, 1.4, 0.95);
    words(context, 'km/h', 0.76, 1.3, 0.28);
  } else if (Object.hasOwn(SYMBOLS, symbol)) {
    context.save();
    const size = shape === 'wide' ? 0.42 : style === 'warn' ? 0.44 : 0.62;
    context.translate(0, style === 'warn' ? 0.32 : 0);
    context.scale(symbol.startsWith('across') && shape === 'wide' ? 0.85 : size, size);
    SYMBOLS[symbol](context);
    context.restore();
  } else if (shape === 'wide') {
    lines(context, text);
  } else {
    words(context, text, 0, 1.3, text.length > 2 ? 0.66 : 0.92);
  }
}

function zone(context: Context, text: string, over: boolean) {
  context.fillStyle = over ? '#8d8f92' : RED;
  context.beginPath();
  context.arc(0, -0.2, 0.62, 0, 2 * Math.PI);
  context.fill();
  context.fillStyle = WHITE;
  context.beginPath();
  context.arc(0, -0.2, 0.47, 0, 2 * Math.PI);
  context.fill();
  context.fillStyle = over ? '#8d8f92' : BLACK;
  words(context, text, -0.2, 0.8, 0.58);
  words(context, 'ZONE', 0.7, 1.4, 0.36);
}

/** Write text on a wide plate, in as many lines as it needs. */
function lines(context: Context, text: string) {
  const parts: string[] = [];
  for (const word of text.split(' ')) {
    const last = parts.at(-1);
    if (last === undefined || last.length + word.length >= LINE_LETTERS) {
      parts.push(word);
    } else {
      parts[parts.length - 1] = `${last} ${word}`;
    }
  }
  const size = Math.min(0.5, 0.84 / parts.length);
  parts.forEach((part, i) => words(context, part, (i + 0.5 - parts.length / 2) * size, 1.72,
    size));
}

/**
 * Write text as large as fits.
 * @param y of its middle
 * @param room for its length
 * @param size of the letters at most
 */
function words(context: Context, text: string, y: number, room: number, size: number) {
  context.save();
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  // Fonts smaller than a pixel are not drawn well: larger letters are scaled down.
  context.font = `bold 100px ${FONT}`;
  const scale = Math.min(size / 100, room / Math.max(context.measureText(text).width, 1));
  context.translate(0, y + 0.04 * size);
  context.scale(scale, scale);
  context.fillText(text, 0, 0);
  context.restore();
}
