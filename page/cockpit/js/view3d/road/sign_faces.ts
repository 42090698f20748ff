// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * The look of a sign's plate, by commonroad-io's name of its kind.
 *
 * The names are those of TrafficSignIDGermany, which the enumerations of other countries share for
 * common signs, and of TrafficSignIDUsa.
 */

import { KMH } from '../../units.js';

export type PlateShape = 'circle' | 'triangle' | 'yield' | 'octagon' | 'diamond' | 'square'
  | 'wide' | 'tall';

/** A plate: its outline, its style and its content. */
export interface Face {
  shape: PlateShape;
  style: 'prohibit' | 'end' | 'order' | 'warn' | 'stop' | 'yield' | 'priority' | 'blue' | 'white'
    | 'yellow' | 'green' | 'red';
  symbol: string; // a drawing's name, empty for none
  text: string;
}

const warn = (symbol: string): Face => ({ shape: 'triangle', style: 'warn', symbol, text: '' });
const prohibit = (symbol: string, text = ''): Face => (
  { shape: 'circle', style: 'prohibit', symbol, text });
const order = (symbol: string, text = ''): Face => (
  { shape: 'circle', style: 'order', symbol, text });
const end = (symbol: string, text = ''): Face => ({ shape: 'circle', style: 'end', symbol, text });
const blue = (symbol: string, text = ''): Face => (
  { shape: 'square', style: 'blue', symbol, text });
const wide = (style: Face['style'], text: string): Face => (
  { shape: 'wide', style, symbol: '', text });

// Limits are multiples of this; files contain rounded values [km/h].
const EVEN_KMH = 5;
const NEARLY_KMH = 0.3;
// Most letters of a name on a plate.
const LONGEST = 24;

const FACES: Record<string, (value: string, country: string) => Face> = {
  MAX_SPEED: (value, country) => (country === 'USA' || country === 'PRI'
    ? { shape: 'tall', style: 'white', symbol: 'limit', text: speedText(value) }
    : prohibit('', speedText(value))),
  MAX_SPEED_ZONE_START: (value) => ({ shape: 'square', style: 'white', symbol: 'zone',
    text: speedText(value) }),
  MAX_SPEED_ZONE_END: (value) => ({ shape: 'square', style: 'white', symbol: 'zone-end',
    text: speedText(value) }),
  MAX_SPEED_END: (value) => end('', speedText(value)),
  MIN_SPEED: (value) => order('', speedText(value)),
  ALL_MAX_SPEED_AND_OVERTAKING_END: () => end(''),
  NO_OVERTAKING_START: () => prohibit('overtaking'),
  NO_OVERTAKING_TRUCKS_START: () => prohibit('overtaking-truck'),
  NO_OVERTAKING_END: () => end('overtaking'),
  NO_OVERTAKING_TRUCKS_END: () => end('overtaking-truck'),
  STOP: () => ({ shape: 'octagon', style: 'stop', symbol: '', text: 'STOP' }),
  STOP_4_WAY: () => ({ shape: 'octagon', style: 'stop', symbol: '', text: 'STOP' }),
  YIELD: () => ({ shape: 'yield', style: 'yield', symbol: '', text: '' }),
  PRIORITY: () => ({ shape: 'diamond', style: 'priority', symbol: '', text: '' }),
  RIGHT_OF_WAY: () => warn('right-of-way'),
  PRIORITY_OVER_ONCOMING: () => blue('first'),
  PRIORITY_OPPOSITE_DIRECTION: () => prohibit('second'),
  NO_ENTRY: () => ({ shape: 'circle', style: 'red', symbol: 'bar', text: '' }),
  DO_NOT_ENTER: () => ({ shape: 'circle', style: 'red', symbol: 'bar', text: '' }),
  BAN_ALL_VEHICLES: () => prohibit(''),
  BAN_CARS: () => prohibit('car'), BAN_TRUCKS: () => prohibit('truck'),
  BAN_BICYCLE: () => prohibit('bicycle'), BAN_PEDESTRIAN: () => prohibit('walker'),
  BAN_BUS: () => prohibit('truck'), BAN_MOTORCYCLE: () => prohibit('bicycle'),
  BAN_CAR_TRUCK_BUS_MOTORCYCLE: () => prohibit('car'),
  MAX_WEIGHT: (value) => prohibit('', `${value}t`),
  MAX_WIDTH: (value) => prohibit('', `${value}m`),
  MAX_HEIGHT: (value) => prohibit('', `${value}m`),
  MAX_LENGTH: (value) => prohibit('', `${value}m`),
  U_TURN: () => prohibit('u-turn'),
  NO_LEFT_TURN: () => prohibit('left'), NO_RIGHT_TURN: () => prohibit('right'),
  NO_STRAIGHT_THROUGH: () => prohibit('up'),
  NO_STOP_START_RIGHT: () => prohibit('no-stopping'), NO_STOPPING: () => prohibit('no-stopping'),
  NO_STOP_CENTER_RIGHT: () => prohibit('no-stopping'),
  RESTRICTED_STOP_CENTER_RIGHT: () => prohibit('no-parking'),
  NO_WAITING: () => prohibit('no-parking'), NO_PARKING: () => prohibit('no-parking'),
  ROUNDABOUT: () => order('roundabout'),
  TURN_RIGHT_AHEAD: () => order('right'), TURN_LEFT_AHEAD: () => order('left'),
  KEEP_STRAIGHT_AHEAD: () => order('up'), PRESCRIBED_DIRECTION_RIGHT: () => order('across-right'),
  RIGHT_TURN_ONLY: () => order('right'), LEFT_TURN_ONLY: () => order('left'),
  PRESCRIBED_PASSING_RIGHT: () => order('down-right'), KEEP_RIGHT: () => order('down-right'),
  PRESCRIBED_PASSING_LEFT: () => order('down-left'),
  BIKEWAY: () => order('bicycle'), PEDESTRIAN_SIDEWALK: () => order('walker'),
  PEDESTRIAN_AND_BICYCLE_ROAD: () => order('walker'), BUS_LANE: () => order('truck'),
  ONEWAY_RIGHT: () => ({ shape: 'wide', style: 'blue', symbol: 'across-right', text: '' }),
  ONEWAY_LEFT: () => ({ shape: 'wide', style: 'blue', symbol: 'across-left', text: '' }),
  ONE_WAY_RIGHT: () => ({ shape: 'wide', style: 'white', symbol: 'across-right', text: '' }),
  ONE_WAY_LEFT: () => ({ shape: 'wide', style: 'white', symbol: 'across-left', text: '' }),
  PEDESTRIANS_CROSSING: () => blue('walker'), PARKING_AREA: () => blue('', 'P'),
  DEAD_END: () => blue('dead-end'), TUNNEL: () => blue('tunnel'),
  TRAFFIC_CALMED_AREA_START: () => blue('walker'), EMERGENCY_STOP: () => blue('', 'SOS'),
  INTERSTATE_START: () => blue('motorway'), INTERSTATE_END: () => blue('motorway-end'),
  HIGHWAY_START: () => blue('car'), HIGHWAY_END: () => blue('motorway-end'),
  BUS_STOP: () => ({ shape: 'circle', style: 'green', symbol: '', text: 'H' }),
  HIGHWAY_EXIT: () => wide('blue', 'Ausfahrt'), EXIT_GENERAL: () => wide('white', 'Ausfahrt'),
  EXIT_BUILT_UP: () => wide('white', 'Ausfahrt'),
  HIGHWAY_EXIT_WITH_PLACE_NAME: (value) => wide('blue', value || 'Ausfahrt'),
  HIGHWAY_EXIT_AHEAD_100_METER: () => wide('blue', '/'),
  HIGHWAY_EXIT_AHEAD_200_METER: () => wide('blue', '/ /'),
  HIGHWAY_EXIT_AHEAD_300_METER: () => wide('blue', '/ / /'),
  TOWN_SIGN: (value) => wide('yellow', value || 'Ort'),
  TOWN_SIGN_BACK: (value) => wide('yellow', value || 'Ort'),
  WARNING_DANGER_SPOT: () => warn('danger'), WARNING_RIGHT_BEFORE_LEFT: () => warn('cross'),
  WARNING_LEFT_CURVE: () => warn('curve-left'), WARNING_RIGHT_CURVE: () => warn('curve-right'),
  WARNING_TRAFFIC_LIGHTS_AHEAD: () => warn('lights'), SIGNAL_AHEAD: () => warn('lights'),
  WARNING_PEDESTRIANS_RIGHT: () => warn('walker'), WARNING_PEDESTRIANS_LEFT: () => warn('walker'),
  PEDESTRIAN_WARNING: () => warn('walker'), WARNING_CROSSING_CYCLIST: () => warn('bicycle'),
  WARNING_ONCOMING_TRAFFIC: () => warn('two-way'), WARNING_CONSTRUCTION_SITE: () => warn('works'),
  ROAD_WORK_AHEAD: () => warn('works'),
};

/**
 * Return the plate of a sign.
 * @param kind name in commonroad-io
 * @param value additional value, as in the file
 * @param country three letters
 * @returns for an unknown kind, a white plate with its name
 */
export function faceOf(kind: string, value: string, country: string): Face {
  if (Object.hasOwn(FACES, kind)) {
    return FACES[kind](value.slice(0, LONGEST), country);
  }
  if (kind.startsWith('WARNING_')) {
    return warn('danger');
  }
  const words = kind.toLowerCase().replaceAll('_', ' ');
  const name = value === '' ? words : `${words} ${value}`;
  return wide('white', name.charAt(0).toUpperCase() + name.slice(1, 2 * LONGEST));
}

/**
 * Return a speed as written on signs.
 * @param value [m/s], as the file has it
 * @returns [km/h], a multiple of 5 if it is nearly one; other text unchanged
 */
export function speedText(value: string): string {
  const kmh = Number(value) * KMH;
  if (value.trim() === '' || !Number.isFinite(kmh)) {
    return value.slice(0, 4);
  }
  const even = Math.round(kmh / EVEN_KMH) * EVEN_KMH;
  return String(Math.abs(kmh - even) < NEARLY_KMH ? even : Math.round(kmh)).slice(0, 4);
}
