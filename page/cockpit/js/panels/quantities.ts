// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The quantities of the history panel, and how they are derived from received data. */

import { DEGREES } from '../units.js';
import { thin, unwrap } from './series.js';

import type { Limits } from '../criticality.js';
import type { VEHICLE } from '../frames.js';
import type { History } from '../history.js';
import type { Exposure, SceneVehicle } from '../messages.js';
import type { ChartView } from './chart.js';
import type { HealthLog } from './series.js';

const DASHES = ['solid', 'dot', 'dash'];

// A line: a column of vehicles' states, a figure of the run's health, the latency of planners,
// the criticality of vehicles now or over the run so far, or a limit.
export interface ColumnLine {
  column: keyof typeof VEHICLE;
  name?: string;
  factor?: number; // to the unit
  angle?: boolean; // whether whole turns are removed
}

export interface HealthLine { name: string; health: 'lag' | 'step_error' }
export interface LatencyLine { latency: true; name?: string }
export interface CriticalLine { critical: string; name?: string }
/** Measures over a run, of a unit. */
export interface ExposureLines { exposures: string; name?: string }
export interface LimitLine { limit: string; name: string }
export type Line = ColumnLine | HealthLine | LatencyLine | CriticalLine | ExposureLines
  | LimitLine;

export interface Quantity {
  key: string;
  title: string;
  unit: string;
  digits: number; // of the newest value
  range?: [number, number]; // of the axis
  lines: Line[];
}

export interface PlottedVehicle {
  id: string;
  role: SceneVehicle['role'];
  color: string;
  past: History;
  critical: (name: string) => { t: number[]; values: number[] };
}

export interface PlotData {
  vehicles: PlottedVehicle[];
  health: HealthLog;
  runColor: string;
  limitColor: string;
  limits: Limits;
  exposures: Exposure[];
}

export type PlotWindow = Pick<ChartView, 'from' | 'to' | 'shown'>;

export interface Trace {
  name: string;
  color: string;
  dash: string;
  x: number[]; // [s]
  y: (number | null)[];
  now: number; // the newest value
}

export const QUANTITIES: Quantity[] = [
  { key: 'speed', title: 'Speed', unit: 'm/s', digits: 2, lines: [{ column: 'speed' }] },
  {
    key: 'acceleration', title: 'Acceleration', unit: 'm/s²', digits: 2,
    lines: [{ column: 'acceleration' }],
  },
  {
    key: 'heading', title: 'Heading', unit: '°', digits: 1,
    lines: [{ column: 'yaw', factor: DEGREES, angle: true }],
  },
  {
    key: 'steering', title: 'Steering angle', unit: '°', digits: 1,
    lines: [{ column: 'steering_angle', factor: DEGREES }],
  },
  {
    key: 'pedals', title: 'Pedals', unit: '%', digits: 0, range: [-3, 103],
    lines: [{ name: 'throttle', column: 'throttle', factor: 100 },
      { name: 'brake', column: 'brake', factor: 100 }],
  },
  {
    key: 'drift', title: 'Drift', unit: 'ms', digits: 3,
    lines: [{ name: 'lag', health: 'lag' }, { name: 'mean step error', health: 'step_error' }],
  },
  { key: 'latency', title: 'Plan latency', unit: 'ms', digits: 0, lines: [{ latency: true }] },
];

/** Make the lines of a quantity; `data` of the vehicles that are selected. */
export function traces(quantity: Quantity, data: PlotData, view: PlotWindow): Trace[] {
  return quantity.lines.flatMap((line, i) => {
    if ('health' in line) {
      return [trace(line.name, data.runColor, DASHES[i], data.health.t,
        data.health.column(line.health), view)];
    }
    if ('limit' in line) {
      return [{
        name: line.name, color: data.limitColor, dash: 'dash', x: [view.from, view.to],
        y: [data.limits[line.limit], data.limits[line.limit]], now: data.limits[line.limit],
      }];
    }
    if ('exposures' in line) {
      return data.exposures.filter(({ unit }) => unit === line.exposures).flatMap(
        ({ name, label }, j) => data.vehicles.map(({ id, color }) => trace(`${id} ${label}`, color,
          DASHES[j % DASHES.length], data.health.t, data.health.exposure(id, name), view)));
    }
    const vehicles = 'latency' in line
      ? data.vehicles.filter((vehicle) => vehicle.role === 'autonomous') : data.vehicles;
    return vehicles.map((vehicle) => {
      const name = line.name ? `${vehicle.id} ${line.name}` : vehicle.id;
      const { t, values } = series(vehicle, line, data.health);
      return trace(name, vehicle.color, DASHES[i], t, values, view);
    });
  });
}

function series(vehicle: PlottedVehicle, line: ColumnLine | LatencyLine | CriticalLine,
  health: HealthLog): { t: number[]; values: number[] } {
  if ('critical' in line) {
    return vehicle.critical(line.critical);
  }
  return 'latency' in line ? { t: health.t, values: health.latency(vehicle.id) }
    : { t: vehicle.past.t, values: column(vehicle.past, line) };
}

function column(past: History, { column: name, factor = 1, angle = false }: ColumnLine) {
  const values = angle ? unwrap(past[name]) : past[name];
  return factor === 1 ? values : values.map((value) => value * factor);
}

function trace(name: string, color: string, dash: string, t: number[], values: number[],
  view: PlotWindow): Trace {
  let newest = t.length - 1;
  while (newest > 0 && t[newest] > view.shown) {
    newest -= 1;
  }
  return { name, color, dash, ...thin(t, values, view.from, view.to), now: values[newest] };
}
