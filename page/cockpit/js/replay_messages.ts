// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * Types of the server's answers about a recorded run: no code here.
 *
 * The server's side is crgame_ros/cockpit/replay_backend.py.
 */

/** @import { AlarmsMessage, EventsMessage, Scene, SeatsMessage, SignalsMessage, Status }
 *   from './messages.js' */

export {};

/**
 * A mark on the time line of a recording.
 *
 * @typedef {{t: number, until_t: number, n: number, k: number, kind: string, subject: string,
 *   text: string, count: number}} ReplayMark
 */

/**
 * Documents of a recorded run over time: each content with the time [s] from which it is valid.
 *
 * @template Content
 * @typedef {[t: number, content: Content][]} Track
 */

/**
 * @typedef {object} ReplayTracks
 * @property {Track<Omit<SignalsMessage, 'type'>>} [signals]
 * @property {Track<Omit<EventsMessage, 'type'>>} [events]
 * @property {Track<Omit<SeatsMessage, 'type'>>} [seats]
 * @property {Track<Omit<AlarmsMessage, 'type'>>} [alarms]
 * @property {Track<Status['timing']>} [timing]
 * @property {Track<Status['planners']>} [planners]
 * @property {Track<Status['drivability']>} [drivability]
 * @property {Track<Status['seats_lost']>} [seats_lost]
 * @property {Track<boolean>} [frames_skipped]
 */

/**
 * @typedef {object} ReplayInfo answer of /api/replay/info
 * @property {number} epoch
 * @property {number[]} epochs of the recording
 * @property {string} recording
 * @property {number} start_s
 * @property {number} end_s
 * @property {number} duration_s
 * @property {number} first_n
 * @property {number} last_n
 * @property {number} k0
 * @property {number} dt_s
 * @property {number} steps_per_tick
 * @property {number} chunk_s
 * @property {number} chunks
 * @property {number} real_time_factor
 * @property {ReplayMark[]} events
 * @property {ReplayTracks} documents
 * @property {string[]} notices
 * @property {Scene} scene
 */
