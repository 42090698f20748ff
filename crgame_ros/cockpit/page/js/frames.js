// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Binary frames of the cockpit: little-endian Float64 values, five of them the header. */

/** Frame kinds, the first value of a frame. */
export const KIND = Object.freeze({
  STATE: 1, OBJECTS: 2, PLAN: 3, PREDICTION: 4, SCAN: 5, ESTIMATE: 6, SEEN: 7, OCCUPANCY: 8,
});

/** Columns of a vehicle's row in a STATE frame. */
export const VEHICLE = Object.freeze({
  x: 0, y: 1, yaw: 2, speed: 3, steering_angle: 4, acceleration: 5, yaw_rate: 6,
  steering_rate: 7, throttle: 8, brake: 9, steering: 10, reverse: 11,
});

/** Values per vehicle in a STATE frame, per object in an OBJECTS frame, per plan point. */
export const VEHICLE_WIDTH = 12;
export const OBJECT_WIDTH = 6;
export const PLAN_WIDTH = 5;

const HEADER = 5;

/**
 * Read one frame without copying its values.
 *
 * @param {ArrayBuffer} buffer the frame
 * @returns {object|null} kind, epoch, n, k, t [s] and by kind: vehicles | objects (rows) |
 *   index and points | index, steps and entries of {column, points} | index, sensor, x, y [m],
 *   yaw, first, increment [rad], longest [m], period_s and ranges | index, x, y, yaw, speed,
 *   yaw_rate and the covariance xx, xy, yy | index and columns | x, y, resolution [m], rows,
 *   columns and bits; null for an unknown kind
 * @throws {RangeError} when the frame is shorter than it says
 */
export function decodeFrame(buffer) {
  const values = new Float64Array(buffer);
  const head = { kind: values[0], epoch: values[1], n: values[2], k: values[3], t: values[4] };
  const rows = (from, count, width) => {
    if (!(count >= 0) || values.length < from + count * width) {
      throw new RangeError(`frame of kind ${head.kind} ends after ${values.length} values`);
    }
    return values.subarray(from, from + count * width);
  };
  switch (head.kind) {
    case KIND.STATE:
      return { ...head, vehicles: rows(HEADER + 1, values[HEADER], VEHICLE_WIDTH) };
    case KIND.OBJECTS:
      return { ...head, objects: rows(HEADER + 1, values[HEADER], OBJECT_WIDTH) };
    case KIND.PLAN:
      return {
        ...head, index: values[HEADER],
        points: rows(HEADER + 2, values[HEADER + 1], PLAN_WIDTH),
      };
    case KIND.PREDICTION:
      return { ...head, index: values[HEADER], ...predictions(values, rows) };
    case KIND.SCAN:
      return { ...head, ...scan(values, rows) };
    case KIND.ESTIMATE: {
      const [x, y, yaw, speed, yaw_rate, xx, xy, yy] = rows(HEADER + 1, 1, 8);
      return { ...head, index: values[HEADER], x, y, yaw, speed, yaw_rate, xx, xy, yy };
    }
    case KIND.SEEN:
      return { ...head, index: values[HEADER], columns: rows(HEADER + 2, values[HEADER + 1], 1) };
    case KIND.OCCUPANCY:
      return { ...head, ...occupancy(buffer, rows) };
    default:
      return null;
  }
}

function scan(values, rows) {
  const [index, sensor, x, y, yaw, first, increment, longest, period_s] = rows(HEADER, 1, 9);
  return {
    index, sensor, x, y, yaw, first, increment, longest, period_s,
    ranges: rows(HEADER + 10, values[HEADER + 9], 1),
  };
}

function occupancy(buffer, rows) {
  const [x, y, resolution, height, width] = rows(HEADER, 1, 5);
  const words = Math.ceil(height * width / 64);
  rows(HEADER + 5, words, 1);
  return {
    x, y, resolution, rows: height, columns: width,
    bits: new Uint8Array(buffer, 8 * (HEADER + 5), 8 * words),
  };
}

function predictions(values, rows) {
  const steps = values[HEADER + 1];
  const entries = [];
  let at = HEADER + 3;
  for (let q = 0; q < values[HEADER + 2]; q += 1) {
    entries.push({ column: values[at], points: rows(at + 1, steps, 3) });
    at += 1 + steps * 3;
  }
  return { steps, entries };
}
