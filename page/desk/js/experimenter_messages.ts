// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The messages from the server to the experimenter's page. */

export interface ItemRow {
  id: string;
  kind: string;
  attempts: number;
  condition: string;
  trial: number | null;
  outcome: string;
  state: 'now' | 'to come' | 'finished' | 'skipped';
}

export interface ParticipantPage {
  connected: boolean;
  open: number;
  round_trip_ms?: number;
  drive_delay_ms?: number;
  seated?: boolean;
  silent_s?: number; // since the page was heard, if that is long ago; nothing else is known then
  error?: string;
}

export interface DriveNow {
  phase: string;
  item: string;
  attempt: number;
  time_s: number | null;
  text: string;
  doubts: string[]; // what of its data is beyond a bound of the study
  watch: string; // address of a page that shows the drive; empty for none
}

export type LogEntry = { entry: string; at: number; [name: string]: unknown }; // of the journal

export interface ExperimenterDocument {
  type: 'desk';
  at: number;
  study: string;
  name: string;
  participant: string;
  place: number;
  group: string | null;
  language: string | null;
  page: ParticipantPage;
  markers: string[];
  item: string;
  held: boolean;
  waits: boolean;
  ending: string;
  over: '' | 'done' | 'declined' | 'excluded' | 'ended';
  can_abort: boolean;
  drive: DriveNow;
  pause_h: number; // how long nothing happened before the session was opened last [h]
  items: ItemRow[];
  log: LogEntry[];
}
