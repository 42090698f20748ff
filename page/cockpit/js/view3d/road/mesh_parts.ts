// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Triangles that are drawn at once: positions, normals, colours and ranks. */

export type Rgb = [red: number, green: number, blue: number]; // 0 to 255, as in sRGB
export type Heights = (x: number, y: number) => number; // the height at a point of the map [m]

const UP: readonly [number, number, number] = [0, 0, 1];

/** A collection of triangles; points are passed in map coordinates and kept from the origin. */
export class MeshParts {
  positions: number[] = []; // x, y, z from the origin [m]
  normals: number[] = [];
  colors: number[] = []; // 0 to 255
  ranks: number[] = []; // by vertex: of flat things at one height the highest rank is on top
  indices: number[] = [];
  origin;

  constructor(origin: { x: number; y: number }) {
    this.origin = origin;
  }

  get triangles() {
    return this.indices.length / 3;
  }

  /** @returns index of the vertex */
  vertex(x: number, y: number, z: number, color: Rgb, rank: number, normal = UP): number {
    this.positions.push(x - this.origin.x, y - this.origin.y, z);
    this.normals.push(...normal);
    this.colors.push(...color);
    this.ranks.push(rank);
    return this.ranks.length - 1;
  }

  /**
   * Add the strip between two lines with as many points each.
   * @param left flat polyline
   * @param right flat polyline
   */
  addStrip(left: number[], right: number[], heights: Heights, color: Rgb, rank: number) {
    for (let i = 0; i < left.length; i += 2) {
      this.vertex(left[i], left[i + 1], heights(left[i], left[i + 1]), color, rank);
      const last = this.vertex(right[i], right[i + 1], heights(right[i], right[i + 1]), color,
        rank);
      if (i > 0) {
        this.indices.push(last - 3, last - 2, last - 1, last - 1, last - 2, last);
      }
    }
  }

  /**
   * Add a polygon that is visible from above.
   * @param ring flat polygon
   * @param faces three indices of its points for each triangle
   */
  addFaces(ring: number[], faces: ArrayLike<number>, heights: Heights, color: Rgb, rank: number) {
    const first = this.ranks.length;
    for (let i = 0; i < ring.length; i += 2) {
      this.vertex(ring[i], ring[i + 1], heights(ring[i], ring[i + 1]), color, rank);
    }
    for (let i = 0; i + 2 < faces.length; i += 3) {
      const [a, b, c] = [2 * faces[i], 2 * faces[i + 1], 2 * faces[i + 2]];
      const turn = (ring[b] - ring[a]) * (ring[c + 1] - ring[a + 1])
        - (ring[b + 1] - ring[a + 1]) * (ring[c] - ring[a]);
      // Faces are visible from the side on which they run counterclockwise: from above.
      const [second, third] = turn > 0 ? [b, c] : [c, b];
      this.indices.push(first + a / 2, first + second / 2, first + third / 2);
    }
  }

  /**
   * Add an upright band along a line: the side of a kerb, or of an embankment.
   * @param line flat polyline; the wall is visible from its right
   */
  addWall(line: number[], bottom: Heights, top: Heights, color: Rgb) {
    for (let i = 0; i + 3 < line.length; i += 2) {
      const [x0, y0, x1, y1] = line.slice(i, i + 4);
      const length = Math.hypot(x1 - x0, y1 - y0) || 1;
      const normal: [number, number, number] = [(y1 - y0) / length, (x0 - x1) / length, 0];
      const first = this.vertex(x0, y0, bottom(x0, y0), color, 0, normal);
      this.vertex(x1, y1, bottom(x1, y1), color, 0, normal);
      this.vertex(x1, y1, top(x1, y1), color, 0, normal);
      this.vertex(x0, y0, top(x0, y0), color, 0, normal);
      this.indices.push(first, first + 1, first + 2, first, first + 2, first + 3);
    }
  }
}
