// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * What the server says of people, as types: nothing here runs.
 *
 * The other ends are crgame_ros/cockpit/hub.py and crgame_ros/nodes/cockpit/people_feed.py.
 */

export {};

/**
 * What this page may do: `directs` and `drives` now, `may_…` if it wants to.
 *
 * @typedef {{role: string, directs: boolean, drives: boolean, seat: string, may_direct: boolean,
 *   may_drive: boolean}} Rights
 */

/**
 * @typedef {object} Present somebody at a page
 * @property {string} client
 * @property {string} name
 * @property {string} role
 * @property {string|null} seat
 * @property {boolean} away whether the hands are off the controls
 * @property {number|null} round_trip_ms
 * @property {number|null} input_delay_ms from the hand to the answer, at the page
 */

/**
 * @typedef {object} DeviceDelay a device at the machine of the game that drives
 * @property {string} seat
 * @property {string} device its name
 * @property {number|null} command_ms from the kernel's stamp of an input to its command
 * @property {number|null} input_delay_ms to the first state that obeys it
 */

/**
 * `accepted`: whether the page is taken for the one whose key it has.
 *
 * @typedef {{type: 'you', rights: Rights, accepted: boolean}} YouMessage
 * @typedef {{type: 'people', people: Present[], devices: DeviceDelay[]}} PeopleMessage
 */
