// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Polylines as flat lists x0, y0, x1, y1, … [m], added to paths. */

export type Lines = Pick<Path2D, 'moveTo' | 'lineTo'>; // receiver of lines

/** Return the length of a flat polyline [m]. */
export function lengthOf(line: number[]): number {
  let length = 0;
  for (let i = 2; i < line.length; i += 2) {
    length += Math.hypot(line[i] - line[i - 2], line[i + 1] - line[i - 1]);
  }
  return length;
}

/**
 * Find the pose at a distance along a polyline.
 * @param line flat polyline
 * @param distance from its start [m]
 * @returns on the line; beyond its end, the end
 */
export function poseAlong(line: number[],
  distance: number): { x: number; y: number; yaw: number } {
  let rest = distance;
  for (let i = 2; i < line.length; i += 2) {
    const dx = line[i] - line[i - 2];
    const dy = line[i + 1] - line[i - 1];
    const step = Math.hypot(dx, dy);
    if ((rest <= step || i === line.length - 2) && step > 0) {
      const share = Math.min(rest / step, 1);
      return { x: line[i - 2] + share * dx, y: line[i - 1] + share * dy, yaw: Math.atan2(dy, dx) };
    }
    rest -= step;
  }
  return { x: line[0], y: line[1], yaw: 0 };
}

/**
 * Shift a polyline sideways.
 * @param line flat polyline
 * @param offset to the left [m]
 * @returns flat polyline with as many points
 */
export function shifted(line: number[], offset: number): number[] {
  const last = line.length - 2;
  const result = new Array(line.length);
  for (let i = 0; i <= last; i += 2) {
    const before = Math.max(i - 2, 0);
    const after = Math.min(i + 2, last);
    const dx = line[after] - line[before];
    const dy = line[after + 1] - line[before + 1];
    const norm = Math.hypot(dx, dy) || 1;
    result[i] = line[i] - (offset * dy) / norm;
    result[i + 1] = line[i + 1] + (offset * dx) / norm;
  }
  return result;
}

/**
 * Add a whole polyline to a path.
 * @param path receives it
 * @param line flat polyline
 * @param ox subtracted from x [m]
 * @param oy subtracted from y [m]
 */
export function addLine(path: Lines, line: number[], ox: number, oy: number) {
  path.moveTo(line[0] - ox, line[1] - oy);
  for (let i = 2; i < line.length; i += 2) {
    path.lineTo(line[i] - ox, line[i + 1] - oy);
  }
}

/**
 * Add the dashes of a polyline to a path, each by itself: cheaper than dashing at every frame.
 * @param path receives them
 * @param line flat polyline
 * @param ox subtracted from x [m]
 * @param oy subtracted from y [m]
 * @param dash length of a dash [m]
 * @param gap between two dashes [m]
 */
export function addDashes(path: Lines, line: number[], ox: number, oy: number, dash: number,
  gap: number) {
  let drawing = true;
  let left = dash;
  path.moveTo(line[0] - ox, line[1] - oy);
  for (let i = 2; i < line.length; i += 2) {
    const dx = line[i] - line[i - 2];
    const dy = line[i + 1] - line[i - 1];
    const step = Math.hypot(dx, dy);
    let done = 0;
    while (step - done > left) {
      done += left;
      const x = line[i - 2] + (dx * done) / step - ox;
      const y = line[i - 1] + (dy * done) / step - oy;
      if (drawing) {
        path.lineTo(x, y);
      } else {
        path.moveTo(x, y);
      }
      drawing = !drawing;
      left = drawing ? dash : gap;
    }
    left -= step - done;
    if (drawing) {
      path.lineTo(line[i] - ox, line[i + 1] - oy);
    }
  }
}

/**
 * Add a closed outline to a path.
 * @param path receives it
 * @param outline flat polygon
 * @param ox subtracted from x [m]
 * @param oy subtracted from y [m]
 */
export function addPolygon(path: Lines & Pick<Path2D, 'closePath'>, outline: number[], ox: number,
  oy: number) {
  addLine(path, outline, ox, oy);
  path.closePath();
}
