// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * Types of the server's answers about runs, recorded ones too, and scenarios: no code here.
 *
 * The server's side is crgame_ros/cockpit/library.py, replay_backend.py and runs.
 */

import type {
  AlarmsMessage, EventsMessage, Scene, SeatsMessage, SignalsMessage, Status,
} from './messages.js';

// The answers of /api/runs and /api/runs/score about a run.
export interface PastRun {
  id: string;
  name: string;
  title: string;
  scenario: string;
  began_ms: number | null; // since 1970
  duration_s: number | null; // of its recording
  contacts: number | null; // null if unknown
  closed: boolean; // whether it can be read
  finished: boolean; // whether it can be deleted
  bytes: number;
  files: { name: string; bytes: number }[];
}

export interface ScorePart {
  name: string;
  value: number | null;
  weight: number;
  definition: string;
}

export interface VehicleScore {
  vehicle: string;
  role: string;
  score: number | null; // of 1
  parts: ScorePart[];
  distance: number | null; // [m]
  fastest: number | null; // [m/s]
  remarks: string[];
}

export interface Score { vehicles: VehicleScore[]; refusal: string }

// Types of /api/scenarios, /api/preview, /api/planner and /api/load.
export interface Entry {
  id: string;
  kind: 'game' | 'scenario' | 'upload';
  name: string;
  title: string;
}

export interface Offer {
  folders: { name: string; entries: Entry[] }[];
  planners: string[];
  drivers: string[];
}

export interface PreviewAv {
  id: string;
  planner: string;
  planning_problem: number | null;
  options?: Record<string, string>;
}

export interface PlannerOption { name: string; wanted: string; default: string; meaning: string }

export interface Preview {
  scene: Scene;
  states: { vehicles: (number | null)[][]; objects: (number | null)[][] }; // rows, as in frames
  humans: { id: string; driver: string }[];
  avs: PreviewAv[];
  notices: string[];
}

export interface Choice {
  id: string; // of an entry
  humans: { id: string; driver: string }[];
  avs: { id: string; planner: string; options?: Record<string, string> }[];
}

/** A mark on the time line of a recording. */
export interface ReplayMark {
  t: number;
  until_t: number;
  n: number;
  k: number;
  kind: string;
  subject: string;
  text: string;
  count: number;
}

/**
 * Documents of a recorded run over time: each content with the time [s] from which it is valid.
 */
type Track<Content> = [t: number, content: Content][];

export interface ReplayTracks {
  signals?: Track<Omit<SignalsMessage, 'type'>>;
  events?: Track<Omit<EventsMessage, 'type'>>;
  seats?: Track<Omit<SeatsMessage, 'type'>>;
  alarms?: Track<Omit<AlarmsMessage, 'type'>>;
  timing?: Track<Status['timing']>;
  planners?: Track<Status['planners']>;
  drivability?: Track<Status['drivability']>;
  seats_lost?: Track<Status['seats_lost']>;
  frames_skipped?: Track<boolean>;
}

/** Answer of /api/replay/info. */
export interface ReplayInfo {
  epoch: number;
  epochs: number[]; // of the recording
  recording: string;
  start_s: number;
  end_s: number;
  duration_s: number;
  first_n: number;
  last_n: number;
  k0: number;
  dt_s: number;
  steps_per_tick: number;
  chunk_s: number;
  chunks: number;
  real_time_factor: number;
  events: ReplayMark[];
  documents: ReplayTracks;
  notices: string[];
  scene: Scene;
}
