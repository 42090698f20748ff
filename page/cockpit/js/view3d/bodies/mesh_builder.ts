// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Builder of a body's triangles, with their colours and with normals that keep edges. */

export type Point = [x: number, y: number, z: number]; // [m]
/** Reflected share of the light, and whether it is a shade of the vehicle's own colour. */
export type Tint = [red: number, green: number, blue: number, isPaint?: boolean];

// Faces that meet at a smaller angle are shaded as one curved face.
const SMOOTH_BELOW = Math.cos((38 * Math.PI) / 180);
const ROUNDED = 1000;

/** A collection of triangles; counter-clockwise ones are visible from outside. */
export class MeshBuilder {
  #positions: number[] = [];
  #colors: number[] = [];
  #painted: boolean[] = [];

  /** Return how many triangles there are. */
  get triangles() {
    return this.#positions.length / 9;
  }

  /** Return the opposite corners of the box around it. */
  get bounds(): { low: Point; high: Point } {
    const low: Point = [Infinity, Infinity, Infinity];
    const high: Point = [-Infinity, -Infinity, -Infinity];
    this.#positions.forEach((value, i) => {
      low[i % 3] = Math.min(low[i % 3], value);
      high[i % 3] = Math.max(high[i % 3], value);
    });
    return { low, high };
  }

  /** Add a flat polygon, convex and counter-clockwise from outside. */
  polygon(corners: Point[], tint: Tint): this {
    const [red, green, blue, isPaint = false] = tint;
    for (let i = 2; i < corners.length; i += 1) {
      this.#painted.push(isPaint);
      for (const corner of [corners[0], corners[i - 1], corners[i]]) {
        this.#positions.push(...corner);
        this.#colors.push(red, green, blue);
      }
    }
    return this;
  }

  /**
   * Add a box, which may be narrower at its top.
   * @param taper how much narrower the top is, on each side [m]
   */
  box([x0, y0, z0]: Point, [x1, y1, z1]: Point, tint: Tint,
    { x = 0, y = 0 }: { x?: number; y?: number } = {}): this {
    const low: Point[] = [[x0, y0, z0], [x1, y0, z0], [x1, y1, z0], [x0, y1, z0]];
    const high: Point[] = [[x0 + x, y0 + y, z1], [x1 - x, y0 + y, z1], [x1 - x, y1 - y, z1],
      [x0 + x, y1 - y, z1]];
    this.polygon([...low].reverse(), tint).polygon(high, tint);
    return this.sides(low, high, tint);
  }

  /** Add the sides between two rings, which are counter-clockwise as seen from beyond `high`. */
  sides(low: Point[], high: Point[], tint: Tint): this {
    low.forEach((corner, i) => {
      const next = (i + 1) % low.length;
      this.polygon([corner, low[next], high[next], high[i]], tint);
    });
    return this;
  }

  /**
   * Add a round body along an axis, with its ends.
   * @param length along the axis [m]
   * @param radius [m]
   * @param tint of its side
   * @param ends of its ends
   * @param count of sides
   */
  cylinder(middle: Point, axis: 'x' | 'y' | 'z', length: number, radius: number, tint: Tint,
    ends = tint, count = 14): this {
    const at = (angle: number, side: number): Point => {
      const u = radius * Math.cos(angle);
      const v = radius * Math.sin(angle);
      const along = side * 0.5 * length;
      const [x, y, z] = axis === 'x' ? [along, u, v]
        : axis === 'y' ? [v, along, u] : [u, v, along];
      return [middle[0] + x, middle[1] + y, middle[2] + z];
    };
    const angles = Array.from({ length: count }, (_, i) => (2 * Math.PI * i) / count);
    this.polygon(angles.map((angle) => at(angle, 1)), ends);
    this.polygon(angles.map((angle) => at(-angle, -1)), ends);
    angles.forEach((angle, i) => {
      const next = angles[(i + 1) % count];
      this.polygon([at(angle, -1), at(next, -1), at(next, 1), at(angle, 1)], tint);
    });
    return this;
  }

  /**
   * Add a skin over cross-sections, all of the same number of points.
   * @param sections from the back to the front, each from the right to the left over the top
   * @param tint of the strip between a section and the next, and between a point and the next
   */
  skin(sections: Point[][], tint: (section: number, strip: number) => Tint): this {
    for (let i = 0; i + 1 < sections.length; i += 1) {
      for (let j = 0; j + 1 < sections[i].length; j += 1) {
        this.polygon([sections[i][j], sections[i + 1][j], sections[i + 1][j + 1],
          sections[i][j + 1]], tint(i, j));
      }
    }
    return this;
  }

  /** Return the painted triangles, or all others: of all corners, flat, three numbers each. */
  arrays(painted: boolean): Record<'positions' | 'normals' | 'colors', Float32Array> {
    const chosen = (values: ArrayLike<number>) => new Float32Array(Array.prototype.filter.call(
      values, (_, i) => this.#painted[Math.floor(i / 9)] === painted));
    return {
      positions: chosen(this.#positions), normals: chosen(smoothNormals(this.#positions)),
      colors: chosen(this.#colors),
    };
  }
}

function smoothNormals(positions: number[]): Float32Array {
  const faces = faceNormals(positions);
  const around = new Map<string, number[]>();
  const keyOf = (corner: number): string => [0, 1, 2].map(
    (axis) => Math.round(positions[3 * corner + axis] * ROUNDED)).join();
  for (let corner = 0; 3 * corner < positions.length; corner += 1) {
    const key = keyOf(corner);
    const there = around.get(key) ?? [];
    there.push(Math.floor(corner / 3));
    around.set(key, there);
  }
  const normals = new Float32Array(positions.length);
  for (let corner = 0; 3 * corner < positions.length; corner += 1) {
    const own = faces[Math.floor(corner / 3)];
    const sum = [0, 0, 0];
    for (const face of around.get(keyOf(corner)) ?? []) {
      const other = faces[face];
      if (own.unit[0] * other.unit[0] + own.unit[1] * other.unit[1]
          + own.unit[2] * other.unit[2] >= SMOOTH_BELOW) {
        other.area.forEach((value, axis) => { sum[axis] += value; });
      }
    }
    const length = Math.hypot(...sum) || 1;
    normals.set(sum.map((value) => value / length), 3 * corner);
  }
  return normals;
}

/** @returns of each triangle, as long as twice its area, and of length 1 */
function faceNormals(positions: number[]): { area: number[]; unit: number[] }[] {
  const faces = [];
  for (let i = 0; i < positions.length; i += 9) {
    const [ax, ay, az, bx, by, bz, cx, cy, cz] = positions.slice(i, i + 9);
    const u = [bx - ax, by - ay, bz - az];
    const v = [cx - ax, cy - ay, cz - az];
    const area = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const length = Math.hypot(...area) || 1;
    faces.push({ area, unit: area.map((value) => value / length) });
  }
  return faces;
}
