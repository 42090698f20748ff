// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * Types of the server's messages about people: no code here.
 *
 * The server's side is crgame_ros/cockpit/hub.py and crgame_ros/nodes/cockpit/people_feed.py.
 */

export {};

/**
 * The rights of this page: `directs` and `drives` are in use, `may_…` are granted.
 *
 * @typedef {{role: string, directs: boolean, drives: boolean, seat: string, may_direct: boolean,
 *   may_drive: boolean}} Rights
 */

/**
 * @typedef {object} Present a person at a page
 * @property {string} client
 * @property {string} name
 * @property {string} role
 * @property {string|null} seat
 * @property {boolean} away whether the controls are released
 * @property {number|null} round_trip_ms
 * @property {number|null} input_delay_ms from an input to the visible answer, at the page
 */

/**
 * @typedef {object} DeviceDelay a device at the machine of the game that drives
 * @property {string} seat
 * @property {string} device its name
 * @property {number|null} command_ms from the kernel's stamp of an input to its command
 * @property {number|null} input_delay_ms to the first state that obeys it
 */

/**
 * `accepted`: whether the server has recognised the page by its key.
 *
 * @typedef {{type: 'you', rights: Rights, accepted: boolean}} YouMessage
 * @typedef {{type: 'people', people: Present[], devices: DeviceDelay[]}} PeopleMessage
 */
