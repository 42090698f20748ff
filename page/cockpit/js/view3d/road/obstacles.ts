// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Permanent obstacles as low walls: the occupied cells of the map around the vehicles. */

import { MeshParts } from './mesh_parts.js';
import { geometryOf } from './materials.js';
import { addBox } from './scenery_shapes.js';

import type { Material } from 'three';
import type { OccupancyFrame } from '../../frames.js';
import type { Origin } from '../local_origin.js';
import type { Heights, Rgb } from './mesh_parts.js';
import type { Three } from '../three.js';

export interface Block { row: number; rows: number; column: number; columns: number } // of cells

// Their height is unknown: that of kerbs and low fences, which do not block the view [m].
const HEIGHT_M = 0.35;
const COLOR: Rgb = [150, 146, 140];
// More blocks than this are not drawn: such a map is noise.
const MOST_BLOCKS = 6000;

/** The newest map of obstacles. */
export class Obstacles {
  #three;
  #origin;
  #heights;
  #map: OccupancyFrame | null = null;
  mesh;

  constructor(three: Three, origin: Origin, heights: Heights, painted: Material) {
    this.#three = three;
    this.#origin = origin;
    this.#heights = heights;
    this.mesh = new three.Mesh(new three.BufferGeometry(), painted);
    this.mesh.visible = false;
  }

  /** @param map of the store */
  update(map: OccupancyFrame | null) {
    if (map === this.#map) {
      return;
    }
    this.#map = map;
    this.mesh.geometry.dispose();
    const blocks = map === null ? [] : blocksOf(map);
    this.mesh.visible = blocks.length > 0;
    if (map !== null && this.mesh.visible) {
      this.mesh.geometry = this.#geometry(map, blocks);
    }
  }

  #geometry({ x, y, resolution }: OccupancyFrame, blocks: Block[]) {
    const parts = new MeshParts(this.#origin);
    for (const { row, rows, column, columns } of blocks) {
      const [x0, y0] = [x + column * resolution, y + row * resolution];
      const [x1, y1] = [x0 + columns * resolution, y0 + rows * resolution];
      const ground = this.#heights((x0 + x1) / 2, (y0 + y1) / 2);
      addBox(parts, [x0, y0, ground - 0.1], [x1, y1, ground + HEIGHT_M], COLOR);
    }
    return geometryOf(this.#three, parts);
  }

  /** Free the memory of the graphics card, except the material. */
  dispose() {
    this.mesh.geometry.dispose();
  }
}

/**
 * Join the occupied cells to blocks, along rows and across equal rows.
 * @returns that hold each occupied cell once, MOST_BLOCKS at most
 */
export function blocksOf(
  { rows, columns, bits }: Pick<OccupancyFrame, 'rows' | 'columns' | 'bits'>): Block[] {
  const blocks: Block[] = [];
  let open = new Map<number, Block>(); // those that may go on, by their columns
  for (let row = 0; row < rows && blocks.length < MOST_BLOCKS; row += 1) {
    const next = new Map<number, Block>();
    for (let column = 0; column < columns; column += 1) {
      const start = column;
      while (column < columns && isOccupied(bits, row * columns + column)) {
        column += 1;
      }
      if (column > start) {
        const key = start * (columns + 1) + column;
        const above = open.get(key);
        const block = above ?? { row, rows: 0, column: start, columns: column - start };
        block.rows += 1;
        next.set(key, block);
        if (above === undefined) {
          blocks.push(block);
        }
      }
    }
    open = next;
  }
  return blocks.slice(0, MOST_BLOCKS);
}

function isOccupied(bits: Uint8Array, cell: number) {
  return (bits[cell >> 3] >> (cell & 7) & 1) === 1;
}
