// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * Types of the server's messages about people: no code here.
 *
 * The server's side is crgame_ros/cockpit/hub.py.
 */

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
