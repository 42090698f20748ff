// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * Types of the server's answers about a recorded run: no code here.
 *
 * The server's side is crgame_ros/cockpit/replay_backend.py.
 */

import type {
  AlarmsMessage, EventsMessage, Scene, SeatsMessage, SignalsMessage, Status,
} from './messages.js';

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
export type Track<Content> = [t: number, content: Content][];

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
