// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The messages from the server to the experimenter's page. */

import type { WordsMessage } from './desk_messages.js';

/** The page's words, and the languages that have some. */
export interface ExperimenterWords extends WordsMessage { languages: string[] }

/** A value of a drive that is beyond its bound, both in the unit. */
export interface Doubt {
  check: string;
  value: number;
  bound: number;
  unit: string;
  digits: number; // of the value behind its decimal mark
  least: boolean; // whether the bound is the least value, not the largest
}

export interface ItemRow {
  id: string;
  kind: string;
  what: string; // which one of its kind
  attempts: number;
  condition: string;
  trial: number | null;
  outcome: string;
  reason: string;
  doubts: Doubt[];
  state: 'now' | 'to_come' | 'finished' | 'skipped';
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
  work: string; // present work; empty without
  text: string; // a failure, in the words of the program that failed
  doubts: Doubt[]; // what of its data is beyond a bound of the study
  watch: string; // address of a page that shows the drive; empty for none
  confederate: string; // of the view of an experimenter who drives too; likewise
  awaits_others: boolean; // the participant is ready, those who drive too are not
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
  partners: string[]; // ids of those who drive together with the participant
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
