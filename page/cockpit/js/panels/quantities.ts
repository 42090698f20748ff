// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The quantities of the history panel, and how they are derived from received data. */

import { thin, unwrap } from './series.js';

/** @import { Limits } from '../criticality.js' */
/** @import { VEHICLE } from '../frames.js' */
/** @import { History } from '../history.js' */
/** @import { Exposure, SceneVehicle } from '../messages.js' */
/** @import { ChartView } from './chart.js' */
/** @import { HealthLog } from './series.js' */

const DEGREES = 180 / Math.PI;
const DASHES = ['solid', 'dot', 'dash'];

/**
 * A line: a column of vehicles' states, a figure of the run's health, the latency of planners,
 * the criticality of vehicles now or over the run so far, or a limit.
 *
 * @typedef {object} ColumnLine
 * @property {keyof typeof VEHICLE} column
 * @property {string} [name]
 * @property {number} [factor] to the unit
 * @property {boolean} [angle] whether whole turns are removed
 * @typedef {{name: string, health: 'lag'|'step_error'}} HealthLine
 * @typedef {{latency: true, name?: string}} LatencyLine
 * @typedef {{critical: string, name?: string}} CriticalLine
 * @typedef {{exposures: string, name?: string}} ExposureLines measures over a run, of a unit
 * @typedef {{limit: string, name: string}} LimitLine
 * @typedef {ColumnLine|HealthLine|LatencyLine|CriticalLine|ExposureLines|LimitLine} Line
 */

/**
 * @typedef {object} Quantity
 * @property {string} key
 * @property {string} title
 * @property {string} unit
 * @property {number} digits of the newest value
 * @property {[number, number]} [range] of the axis
 * @property {Line[]} lines
 */

/**
 * @typedef {{id: string, role: SceneVehicle['role'], color: string, past: History,
 *   critical: (name: string) => {t: number[], values: number[]}}} PlottedVehicle
 * @typedef {{vehicles: PlottedVehicle[], health: HealthLog, runColor: string,
 *   limitColor: string, limits: Limits, exposures: Exposure[]}} PlotData
 * @typedef {Pick<ChartView, 'from'|'to'|'shown'>} PlotWindow
 */

/**
 * @typedef {object} Trace
 * @property {string} name
 * @property {string} color
 * @property {string} dash
 * @property {number[]} x [s]
 * @property {(number|null)[]} y
 * @property {number} now the newest value
 */

/** @type {Quantity[]} */
export const QUANTITIES = [
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

/**
 * Make the lines of a quantity.
 *
 * @param {Quantity} quantity
 * @param {PlotData} data of the vehicles that are selected
 * @param {PlotWindow} view
 * @returns {Trace[]}
 */
export function traces(quantity, data, view) {
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

/**
 * @param {PlottedVehicle} vehicle
 * @param {ColumnLine|LatencyLine|CriticalLine} line
 * @param {HealthLog} health
 * @returns {{t: number[], values: number[]}}
 */
function series(vehicle, line, health) {
  if ('critical' in line) {
    return vehicle.critical(line.critical);
  }
  return 'latency' in line ? { t: health.t, values: health.latency(vehicle.id) }
    : { t: vehicle.past.t, values: column(vehicle.past, line) };
}

/**
 * @param {History} past
 * @param {ColumnLine} line
 */
function column(past, { column: name, factor = 1, angle = false }) {
  const values = angle ? unwrap(past[name]) : past[name];
  return factor === 1 ? values : values.map((value) => value * factor);
}

/**
 * @param {string} name
 * @param {string} color
 * @param {string} dash
 * @param {number[]} t
 * @param {number[]} values
 * @param {PlotWindow} view
 * @returns {Trace}
 */
function trace(name, color, dash, t, values, view) {
  let newest = t.length - 1;
  while (newest > 0 && t[newest] > view.shown) {
    newest -= 1;
  }
  return { name, color, dash, ...thin(t, values, view.from, view.to), now: values[newest] };
}
