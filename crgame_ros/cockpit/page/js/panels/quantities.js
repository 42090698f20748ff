// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** What the history panel plots, and how it is made from what the page received. */

import { thin, unwrap } from './series.js';

const DEGREES = 180 / Math.PI;
const DASHES = ['solid', 'dot'];

/**
 * key, title, unit, digits of the newest value, range of the axis or none, and the lines: columns
 * of a vehicle's state (with factor and angle), or figures of the run's health.
 */
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
 * @param {object} quantity one of QUANTITIES
 * @param {object} data vehicles [{id, role, color, past}] that are selected, health, runColor
 * @param {object} view from, to and shown: the time of the newest value [s]
 * @returns {object[]} traces for a Chart
 */
export function traces(quantity, data, view) {
  return quantity.lines.flatMap((line, i) => {
    if (line.health) {
      return [trace(line.name, data.runColor, DASHES[i], data.health.t,
        data.health.column(line.health), view)];
    }
    const vehicles = line.latency
      ? data.vehicles.filter((vehicle) => vehicle.role === 'autonomous') : data.vehicles;
    return vehicles.map((vehicle) => {
      const name = line.name ? `${vehicle.id} ${line.name}` : vehicle.id;
      const t = line.latency ? data.health.t : vehicle.past.t;
      const values = line.latency ? data.health.latency(vehicle.id) : column(vehicle.past, line);
      return trace(name, vehicle.color, DASHES[i], t, values, view);
    });
  });
}

function column(past, { column: name, factor = 1, angle = false }) {
  const values = angle ? unwrap(past[name]) : past[name];
  return factor === 1 ? values : values.map((value) => value * factor);
}

function trace(name, color, dash, t, values, view) {
  let newest = t.length - 1;
  while (newest > 0 && t[newest] > view.shown) {
    newest -= 1;
  }
  return { name, color, dash, ...thin(t, values, view.from, view.to), now: values[newest] };
}
