// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** What the server takes from pages. Written by scripts/make_page_types.py: do not edit. */

/** Messages that get a reply, before they have a number. */
export type Unnumbered<T> = T extends { id: number } ? Omit<T, 'id'> : never;

/** The session ends early. */
export interface End {
  type: 'end';
  id: number;
  reason: string;
}

/** The participant has finished an item that is not driven. */
export interface Finish {
  type: 'finish';
  item: string;
  answers?: Record<string, number | string | string[] | null>;
  shown_at: number;
  answered_at: number;
  taken_s: number;
  after_s?: Record<string, number>;
  agreed?: boolean | null;
  device?: string | null;
  moved?: string[];
}

/** A participant's page is there. */
export interface Hello {
  type: 'hello';
  page: string;
  fresh: boolean;
}

/** The participant takes part at this page, of several. */
export interface Here {
  type: 'here';
}

/** The session stops after the present item, or goes on. */
export interface Hold {
  type: 'hold';
  id: number;
  held: boolean;
}

/** The language of the participant, or of the experimenter's page. */
export interface Language {
  type: 'language';
  language: string;
}

/** A marker in the recording. */
export interface Mark {
  type: 'mark';
  id: number;
  name: string;
}

/** A note about the session. */
export interface Note {
  type: 'note';
  id: number;
  text: string;
}

/** A request for a pong, with what the page has measured. */
export interface Ping {
  type: 'ping';
  t: number;
  round_trip_ms?: number | null;
  drive_delay_ms?: number | null;
  seated?: boolean | null;
}

/** The participant is ready for a drive. */
export interface Ready {
  type: 'ready';
  item: string;
}

/** An item is driven again, is left out, or ends early. */
export interface Reasoned {
  type: 'repeat' | 'skip' | 'abort';
  id: number;
  item: string;
  reason: string;
}

export type ParticipantMessage = Hello | Here | Language | Ready | Finish | Ping;

export type ExperimenterMessage = Note | Mark | Reasoned | End | Hold | Language | Ping;
