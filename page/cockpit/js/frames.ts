// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Decoder of the cockpit's binary frames: little-endian Float64 values, with a header of five. */

/** Frame kinds, the first value of a frame. */
export const KIND = Object.freeze({
  STATE: 1, OBJECTS: 2, PLAN: 3, PREDICTION: 4, SCAN: 5, ESTIMATE: 6, SEEN: 7, OCCUPANCY: 8,
  CRITICALITY: 9,
});

/** Columns of a vehicle's row in a STATE frame. */
export const VEHICLE = Object.freeze({
  x: 0, y: 1, yaw: 2, speed: 3, steering_angle: 4, acceleration: 5, yaw_rate: 6,
  steering_rate: 7, throttle: 8, brake: 9, steering: 10, reverse: 11,
  lights: 12,
});

/** Values per vehicle in a STATE frame, per object in an OBJECTS frame, per plan point. */
export const VEHICLE_WIDTH = 13;
export const OBJECT_WIDTH = 6;
export const PLAN_WIDTH = 5;

const HEADER = 5;

export interface Head {
  epoch: number; // counts resets
  n: number; // simulation step
  k: number; // scenario step
  t: number; // simulation time [s]
}

// Rows are flat; an index is that of a vehicle, a column counts vehicles, then objects.
export interface StateFrame extends Head { kind: typeof KIND.STATE; vehicles: Float64Array }
export interface ObjectsFrame extends Head { kind: typeof KIND.OBJECTS; objects: Float64Array }

export interface PlanFrame extends Head {
  kind: typeof KIND.PLAN;
  index: number;
  points: Float64Array;
}

export interface PredictionEntry { column: number; points: Float64Array }

export interface PredictionFrame extends Head {
  kind: typeof KIND.PREDICTION;
  index: number;
  steps: number;
  entries: PredictionEntry[];
}

export interface SeenFrame extends Head {
  kind: typeof KIND.SEEN;
  index: number;
  columns: Float64Array;
}

export interface ScanFrame extends Head, Scan { kind: typeof KIND.SCAN }

export interface EstimateFrame extends Head {
  kind: typeof KIND.ESTIMATE;
  index: number;
  x: number; // of the rear axle [m]
  y: number; // [m]
  yaw: number; // [rad]
  speed: number; // [m/s]
  yaw_rate: number; // [rad/s]
  xx: number; // covariance [m^2]
  xy: number;
  yy: number;
}

export interface OccupancyFrame extends Head, Occupancy { kind: typeof KIND.OCCUPANCY }

export interface CriticalityFrame extends Head {
  kind: typeof KIND.CRITICALITY;
  width: number;
  rows: Float64Array;
}

export type PerceptionFrame = ScanFrame | EstimateFrame | SeenFrame | OccupancyFrame;
export type Frame = StateFrame | ObjectsFrame | PlanFrame | PredictionFrame | PerceptionFrame
  | CriticalityFrame;

export interface Scan {
  index: number;
  sensor: number;
  x: number; // of the sensor at the time of the scan [m]
  y: number; // [m]
  yaw: number; // [rad]
  first: number; // angle of the first ray [rad]
  increment: number; // from ray to ray [rad]
  longest: number; // horizon [m]
  period_s: number;
  ranges: Float64Array; // [m]
}

export interface Occupancy {
  x: number; // of the lower left corner [m]
  y: number; // [m]
  resolution: number; // [m]
  rows: number;
  columns: number;
  bits: Uint8Array; // one for each cell, row by row
}

type ReadRows = (from: number, count: number, width: number) => Float64Array;

/**
 * Read one frame without copying its values.
 * @returns null for an unknown kind
 * @throws {RangeError} if the frame is shorter than its header says
 */
export function decodeFrame(buffer: ArrayBuffer): Frame | null {
  const values = new Float64Array(buffer);
  const kind = values[0];
  const head = { epoch: values[1], n: values[2], k: values[3], t: values[4] };
  const rows: ReadRows = (from, count, width) => {
    if (!(count >= 0) || values.length < from + count * width) {
      throw new RangeError(`frame of kind ${kind} ends after ${values.length} values`);
    }
    return values.subarray(from, from + count * width);
  };
  switch (kind) {
    case KIND.STATE:
      return { ...head, kind, vehicles: rows(HEADER + 1, values[HEADER], VEHICLE_WIDTH) };
    case KIND.OBJECTS:
      return { ...head, kind, objects: rows(HEADER + 1, values[HEADER], OBJECT_WIDTH) };
    case KIND.PLAN:
      return {
        ...head, kind, index: values[HEADER],
        points: rows(HEADER + 2, values[HEADER + 1], PLAN_WIDTH),
      };
    case KIND.PREDICTION:
      return { ...head, kind, index: values[HEADER], ...predictions(values, rows) };
    case KIND.SCAN:
      return { ...head, kind, ...scan(values, rows) };
    case KIND.ESTIMATE: {
      const [x, y, yaw, speed, yaw_rate, xx, xy, yy] = rows(HEADER + 1, 1, 8);
      return { ...head, kind, index: values[HEADER], x, y, yaw, speed, yaw_rate, xx, xy, yy };
    }
    case KIND.SEEN:
      return {
        ...head, kind, index: values[HEADER], columns: rows(HEADER + 2, values[HEADER + 1], 1),
      };
    case KIND.OCCUPANCY:
      return { ...head, kind, ...occupancy(buffer, rows) };
    case KIND.CRITICALITY: {
      // A row has the vehicle's index, and of each measure the value and the other object.
      const width = (values.length - HEADER - 1) / (values[HEADER] || 1);
      return { ...head, kind, width, rows: rows(HEADER + 1, values[HEADER], Math.max(width, 1)) };
    }
    default:
      return null;
  }
}

function scan(values: Float64Array, rows: ReadRows): Scan {
  const [index, sensor, x, y, yaw, first, increment, longest, period_s] = rows(HEADER, 1, 9);
  return {
    index, sensor, x, y, yaw, first, increment, longest, period_s,
    ranges: rows(HEADER + 10, values[HEADER + 9], 1),
  };
}

function occupancy(buffer: ArrayBuffer, rows: ReadRows): Occupancy {
  const [x, y, resolution, height, width] = rows(HEADER, 1, 5);
  const words = Math.ceil(height * width / 64);
  rows(HEADER + 5, words, 1);
  return {
    x, y, resolution, rows: height, columns: width,
    bits: new Uint8Array(buffer, 8 * (HEADER + 5), 8 * words),
  };
}

function predictions(values: Float64Array,
  rows: ReadRows): { steps: number; entries: PredictionEntry[] } {
  const steps = values[HEADER + 1];
  const entries = [];
  let at = HEADER + 3;
  for (let q = 0; q < values[HEADER + 2]; q += 1) {
    entries.push({ column: values[at], points: rows(at + 1, steps, 3) });
    at += 1 + steps * 3;
  }
  return { steps, entries };
}
