// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** What the server takes from pages. Written by scripts/make_page_types.py: do not edit. */

/** Messages that get a reply, before they have a number. */
export type Unnumbered<T> = T extends { id: number } ? Omit<T, 'id'> : never;

/** A driver takes an offered seat, or does not. */
export interface Answer {
  type: 'answer';
  id: number;
  seat: string;
  accept: boolean | number;
}

/** A driver asks the driver in a seat for it. */
export interface Ask {
  type: 'ask';
  id: number;
  seat: string;
}

/** A driver wants a seat. */
export interface Claim {
  type: 'claim';
  id: number;
  seat: string;
  device?: string;
}

/** An order of the run control. */
export interface Control {
  type: 'control';
  id: number;
  action: 'start' | 'pause' | 'step' | 'reset' | 'stop';
  all?: boolean | number;
}

/** The device with which the person drives. */
export interface DeviceUsed {
  type: 'device';
  device?: string;
}

/** A driver offers their seat. */
export interface HandOver {
  type: 'hand_over';
  id: number;
  seat: string;
  to: string;
}

/** What the driver in a seat does. */
export interface Input {
  type: 'input';
  seat: string;
  keys?: (boolean | number)[] | null;
  axes?: number[] | null;
  away?: true | null;
  reverse?: boolean | number;
  lights?: (boolean | number)[] | null;
  put_back?: boolean | number;
}

/** What the page wants to be sent; a layer that is not named stays as it is. */
export interface Layers {
  type: 'layers';
  predictions?: boolean | number | null;
  scans?: boolean | number | null;
  perception?: string | '' | null;
}

/** The person's name. */
export interface Name {
  type: 'name';
  name: string;
}

/** Who is at the page. */
export interface Person {
  type: 'person';
  key: string;
  fresh: boolean | number;
}

/** A request for a pong. */
export interface Ping {
  type: 'ping';
  t: number;
  round_trip_ms?: number | null;
}

/** Whether an AV's planner goes on. */
export interface PlannerSwitch {
  type: 'planner';
  id: number;
  av: string;
  run: boolean | number;
}

/** How many simulated seconds pass in a second. */
export interface Rate {
  type: 'rate';
  id: number;
  factor: number;
}

/** A driver in a seat is ready for the start, or not any more. */
export interface Ready {
  type: 'ready';
  id: number;
  seat: string;
  ready: boolean | number;
}

/** A driver gives a seat back. */
export interface Release {
  type: 'release';
  id: number;
  seat: string;
}

/** Which rights the person wants to use. */
export interface Role {
  type: 'role';
  id: number;
  role: 'direct' | 'drive' | 'watch' | 'all';
}

/** The properties of a page's picture. */
export interface SeenView {
  type: 'view';
  shown: 'map' | 'driver' | 'chase' | 'bird';
  inset: boolean | number;
  plans: boolean | number;
  mirrors: boolean | number;
  bare: boolean | number;
  software: boolean | number;
  width_px: number;
  height_px: number;
  ratio: number;
  across_deg?: number | null;
  screen_width_m?: number | null;
  eye_distance_m?: number | null;
  rate_hz?: number | null;
  renderer?: string;
  away?: string;
  full_screen?: boolean | number;
  stage?: string | '';
}

export type ShownThing = [
  kind: 'vehicle' | 'pedestrian' | 'object' | 'sign' | 'traffic_light' | 'mirror' | 'instrument'
    | 'task',
  id: string,
  left: number,
  top: number,
  right: number,
  bottom: number,
  distance_m?: number | null,
  mirror?: string | null,
];

/** How loud the page is, and how strong its gamepad rumbles. */
export interface Sound {
  type: 'sound';
  on: boolean | number;
  volume: number;
  rumble: number;
}

/** What the page has shown, or the driver has answered; times as in `PageTimes`. */
export interface TaskDone {
  type: 'task';
  seat: string;
  task: string;
  number: number;
  what: 'shown' | 'answer';
  response_ms?: number | null;
  delay_ms?: number | null;
  picture_ms?: number | null;
  paused_ms?: number | null;
  steady_s?: number | null;
  clock_error_ms?: number | null;
}

/** An event or a task is triggered. */
export interface Trigger {
  type: 'trigger';
  id: number;
  event: string;
}

export type ViewEye = [
  x: number,
  y: number,
  yaw: number,
  height_m: number,
  pitch: number,
  across: number,
  tall: number,
];

/** What was where in one picture of a driver's view. */
export interface ViewPicture {
  seat: string;
  epoch: number;
  steady_s: number;
  clock_error_ms: number;
  place: ViewPlace;
  eye: ViewEye;
  shown: ShownThing[];
}

export type ViewPlace = [
  left: number,
  top: number,
  width: number,
  height: number,
  screen_width: number,
  screen_height: number,
  ratio: number,
];

/** What was where in a picture of a driver's 3D view. */
export interface ViewTold {
  type: 'picture';
  picture: ViewPicture;
}

export type PageMessage = Input | TaskDone | ViewTold | Claim | Release | Ask | HandOver | Answer
    | Ready | Control | Rate | PlannerSwitch | Trigger | Person | Role | DeviceUsed | Name | Layers
    | Sound | SeenView | Ping;
