// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * The messages from the server to the experimenter's page.
 *
 * @typedef {{id: string, kind: string, attempts: number, condition: string, trial: number|null,
 *   outcome: string, state: 'now'|'to come'|'finished'|'skipped'}} ItemRow
 * @typedef {{connected: boolean, open: number, round_trip_ms?: number, drive_delay_ms?: number,
 *   seated?: boolean, error?: string}} ParticipantPage
 * @typedef {{phase: string, item: string, attempt: number, time_s: number|null, text: string}
 *   } DriveNow
 * @typedef {{entry: string, at: number, [name: string]: unknown}} LogEntry  of the journal
 * @typedef {{type: 'desk', at: number, study: string, name: string, participant: string,
 *   place: number, language: string|null, page: ParticipantPage, markers: string[],
 *   item: string, held: boolean, waits: boolean, ending: string,
 *   over: ''|'done'|'declined'|'ended', can_abort: boolean, drive: DriveNow, items: ItemRow[],
 *   log: LogEntry[]}} ExperimenterDocument
 */
export {};
