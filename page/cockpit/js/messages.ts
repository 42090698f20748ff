// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * Types of the JSON messages between the page and its server: no code here.
 *
 * The server's side is crgame_ros/cockpit/scene.py, hub.py, run_status.py, seat_table.py,
 * runs/archive.py, replay_backend.py and, for the page's messages, page_messages.py. The
 * binary frames are in frames.ts. Polylines and polygons are flat lists x0, y0, x1, y1, … [m].
 */

import type { Control, Input, PageMessage, Role, SeenView, Unnumbered } from './page_messages.js';
import type { GameTask, TasksMessage } from './tasks/task_messages.js';

export type Box = [xmin: number, ymin: number, xmax: number, ymax: number]; // [m]
export interface Pose { x: number; y: number; yaw: number; speed: number } // [m, rad, m/s]

export interface Shape {
  kind: 'rectangle' | 'circle' | 'polygon';
  length: number; // [m]
  width: number; // [m]
  vertices: number[]; // of a polygon, flat
}

export interface Lanelet {
  id: number;
  left: number[]; // bound
  right: number[]; // bound
  center: number[]; // line
  left_z?: number[] | null; // heights of the left bound's points [m], null where flat
  right_z?: number[] | null;
  types: string[]; // CommonRoad's
  left_line: string; // marking of the bound, as CommonRoad calls it
  right_line: string;
  one_way: boolean;
  speed_limit: number | null; // [m/s]
  intersection: boolean;
  adj_left: number | null; // id of the neighbour
  adj_left_same: boolean; // whether it leads the same way
  adj_right: number | null;
  adj_right_same: boolean;
  successors: number[];
}

/** A traffic light; `yaw` is the heading [rad] of the traffic that it controls. */
export interface Light {
  id: number;
  x: number;
  y: number;
  yaw: number;
  direction: string;
  lanelets: number[];
}

/**
 * A traffic sign, named as in TrafficSignIDGermany and the like; `yaw` is its traffic's heading.
 */
export interface Sign {
  id: number;
  x: number;
  y: number;
  yaw: number;
  lanelets: number[];
  kind: string;
  value: string;
  virtual: boolean;
}

export interface Environment { light: 'day' | 'dusk'; visibility: number } // visibility [m]

// Points of a vehicle: ahead of the rear axle, to the left, above the road.
export type Mount = [x: number, y: number, z: number]; // [m]

// [m]; a vehicle without an inner mirror has no cabin
export interface DriverPlace {
  height: number;
  bonnet_height: number;
  eye: Mount;
  left_mirror: Mount;
  right_mirror: Mount;
  inner_mirror: Mount | null;
}

export interface SceneVehicle {
  id: string;
  role: 'human' | 'autonomous';
  shape: Shape;
  rear_to_center: number; // [m]
  wheelbase: number; // [m]
  max_steering_angle: number; // [rad]
  type: string; // CommonRoad obstacle type
  powertrain: 'combustion' | 'electric' | 'muscle';
  driver_place: DriverPlace;
  // range [m], null for no limit
  perception: { localisation: boolean; sensors: string[]; range: number | null } | null;
}

export type ObjectRole = 'recorded' | 'static' | 'traffic' | 'scripted';
export interface SceneObject { id: string; type: string; role: ObjectRole; shape: Shape }

// The action of an event of the game, by its kind.
export interface ReleaseAction { kind: 'release'; object: string }
export interface BrakeAction { kind: 'brake'; object: string; deceleration: number; speed: number }

export interface ObstacleAction {
  kind: 'obstacle';
  x: number;
  y: number;
  length: number;
  width: number;
  type: string;
}

export interface SpeedLimitAction { kind: 'speed_limit'; speed: number; lanelets: number[] }
export interface PlanDisplayAction { kind: 'plan_display'; av: string; show: boolean }
export interface PlannerAction { kind: 'planner'; av: string; planner: string }
export interface PlannerRunAction { kind: 'planner_run'; av: string; run: boolean }
export type EventAction = ReleaseAction | BrakeAction | ObstacleAction | SpeedLimitAction
  | TrafficAction | PlanDisplayAction | PlannerAction | PlannerRunAction;

export interface TrafficAction {
  kind: 'traffic';
  agent: string; // id, or all
  options?: Record<string, unknown>;
  speed_factor?: number;
  desired_speed?: number; // [m/s]
  politeness?: number;
  lane_changes?: boolean;
  reaction_time?: number; // [s]
  imperfection?: number;
  red_runner?: boolean;
  late_yielder?: boolean;
}

export type EventCondition = { time: number } | { step: number }
  | { between: [string, string]; distance: number }
  | { vehicle: string; x: number; y: number; radius: number };
export type GameEvent = { name: string; label: string; when: EventCondition | null } & EventAction;

export interface SceneTime {
  epoch: number; // counts resets
  dt_s: number;
  dt_c_s: number; // of a scenario step
  k0: number;
  clock_offset_s: number;
  duration_s: number | null;
}

/** Everything that does not change during a run. */
export interface Scene {
  id: string;
  benchmark_id: string;
  title: string;
  bounds: Box;
  country: string; // three letters, ZAM if unknown
  environment: Environment;
  lanelets: Lanelet[];
  gaps: number[][]; // slits between lanelets, for display only
  stop_lines: { points: number[]; lanelet: number; line: string }[];
  lights: Light[];
  signs: Sign[];
  vehicles: SceneVehicle[];
  objects: SceneObject[];
  goals: { av: string; polygons: number[][] }[];
  time: SceneTime;
  drivers: Record<string, string>;
  planners: Record<string, string>;
  occupancy: boolean; // whether there is a map of permanent obstacles
  events: GameEvent[];
  tasks?: GameTask[];
  language?: string; // of the texts for drivers
  gaze?: string[]; // vehicles whose drivers' gaze is recorded: their pages tell what they show
  contact: 'through' | 'stop'; // what a contact does to a vehicle that a person drives
  sound: 'on' | 'none'; // whether pages may sound and gamepads rumble
  again?: number; // counts how often a recording was played
}

export interface Person { client: string; name: string }

export interface Seat {
  source: string; // of the commands that the vehicle obeys
  driver: string; // the source that the game names
  holder: string | null; // id of a client
  holder_name: string | null;
  requests?: Person[]; // persons that ask for it
  others?: Person[]; // persons that could get it
  offer?: Person | null; // person to which its holder offers it
  kept?: { name: string; for_s: number } | null; // for its absent driver, and how long
  ready?: boolean; // whether its driver is ready to begin
  device?: string; // of its driver, as its page reports it
  lost?: boolean; // whether its driver is silent
}

export interface FiredEvent { name: string; n: number; k: number; by: string }

export interface Alarm {
  id: string;
  kind: string;
  subject: string;
  text: string;
  since_t?: number; // [s]
}

export type RunState = 'waiting' | 'running' | 'paused' | 'ended';

export interface Recording {
  state: 'none' | 'recording' | 'recorded' | 'failed' | 'unknown';
  messages?: number;
  megabytes?: number;
  text?: string;
}

export interface PlannerStatus {
  running: boolean;
  stale: boolean;
  latency_ms: number | null;
  age_ms: number | null;
  accepted: number;
  refused: number;
  of_others: number; // plans of other programs than its planner
  failure: string; // why it braked last
  plan_time_ms: number | null;
  fallbacks: number | null;
  planner: string;
  last_refusal: string;
  tracking: Record<string, number | null> | null;
}

/** Figures and texts of the time-sync supervisor by key; in timing.json some are nested. */
export type Timing = Record<string, number | boolean | string | null | undefined
  | Record<string, number | null>>;

export interface Contact { vehicle: string; with: string; t: number }
export interface NamedContact { vehicle: string; with: string; side: string; avoidable_by: string }

/** A measure of criticality. */
export interface Measure {
  name: string;
  label: string;
  unit: string;
  worst: -1 | 1; // whether smaller (-1) or greater (1) values are more critical
  limit: number | null; // beyond which it is critical; null for none
  definition: string;
}

/** A measure of a vehicle over a whole run. */
export interface Exposure {
  name: string;
  label: string;
  unit: string;
  definition: string;
}

/** The worst values so far by measure, and the thresholds of criticality. */
export interface Criticality {
  critical: boolean; // now
  exposures: Record<string, number | null>; // over the run so far, by name
  worst: Record<string, { value: number | null; of: string; t: number | null }>;
  thresholds: Record<string, number | null>;
}

export interface Status {
  run: RunState;
  reason?: string; // why it ended
  stays?: boolean; // whether the program continues after the run
  awaited?: string[]; // seats without a driver
  countdown_s?: number; // until the run begins; 0 for none
  contacts?: Contact[];
  departures?: { vehicle: string; t: number }[];
  real_time_factor: number;
  measured_factor: number | null;
  recording: Recording;
  timing: Timing | null;
  planners: Record<string, PlannerStatus>;
  drivability: Record<string, { collision: boolean; off_road: boolean; hit: string[] }>;
  criticality?: Record<string, Criticality>;
  seats_lost: Record<string, boolean>;
  frames_skipped: boolean;
  t: number; // [s]
  n: number;
  k: number;
  epoch: number;
  clients: number;
}

export interface Files {
  epoch: number;
  run: string; // id in /api/runs
  folder: string;
  names: string[];
  complete: boolean;
  contacts: NamedContact[];
}

export type NoticeLevel = 'info' | 'warn' | 'error';

// Messages from the server to the store.
export interface HelloMessage {
  type: 'hello';
  client: string;
  name: string;
  mode: 'live' | 'replay';
  version: string;
  program?: string;
  rights: Rights;
  framed_by?: string; // origins, with spaces between them
  measures?: Measure[];
  exposures?: Exposure[];
}

export interface SceneMessage extends Scene { type: 'scene' }
export interface SeatsMessage { type: 'seats'; seats: Record<string, Seat> }

export interface SignalsMessage {
  type: 'signals';
  k: number;
  states: Record<string, string>;
  objects: Record<string, number>;
}

export interface EventsMessage { type: 'events'; fired: FiredEvent[] }
export interface AlarmsMessage { type: 'alarms'; active: Alarm[] }
export interface StatusMessage extends Status { type: 'status' }
export interface FilesMessage extends Files { type: 'files' }
export interface NoticeMessage { type: 'notice'; level: NoticeLevel; text: string }
export type StoreMessage = HelloMessage | SceneMessage | SeatsMessage | SignalsMessage
  | EventsMessage | AlarmsMessage | StatusMessage | FilesMessage | NoticeMessage | YouMessage
  | PeopleMessage | TasksMessage;

// Answers of the server to one page.
export interface Reply { ok: boolean; text: string }
export interface ReplyMessage extends Reply { type: 'reply'; to: number }
export interface PongMessage { type: 'pong'; t: number; steady_s: number }
export type ServerMessage = StoreMessage | ReplyMessage | PongMessage;

// Messages from the page, as the server declares them; requests get their number when they are
// sent.
export type { PageMessage };
export type RequestMessage = Unnumbered<PageMessage>;
export type Hands = Omit<Input, 'type' | 'seat'>;
export type RunAction = Control['action'];
export type ViewMessage = SeenView;
export type RoleName = Role['role'];

/** The rights of this page: `directs` and `drives` are in use, `may_…` are granted. */
export interface Rights {
  role: string;
  directs: boolean;
  drives: boolean;
  seat: string;
  may_direct: boolean;
  may_drive: boolean;
}

/** A person at a page. */
export interface Present {
  client: string;
  name: string;
  role: string;
  seat: string | null;
  away: boolean; // whether the controls are released
  round_trip_ms: number | null;
  input_delay_ms: number | null; // from an input to the visible answer, at the page
}

/** A device at the machine of the game that drives. */
export interface DeviceDelay {
  seat: string;
  device: string; // its name
  command_ms: number | null; // from the kernel's stamp of an input to its command
  input_delay_ms: number | null; // to the first state that obeys it
}

// `accepted`: whether the server has recognised the page by its key.
export interface YouMessage { type: 'you'; rights: Rights; accepted: boolean }
export interface PeopleMessage { type: 'people'; people: Present[]; devices: DeviceDelay[] }
