// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * Types of the messages about tasks between the page and its server: no code here.
 *
 * The server's side is crgame_ros/cockpit/scene.py, crgame_ros/game/task_documents.py and, for
 * the page's messages, crgame_ros/cockpit/page_messages.py.
 *
 * @typedef {object} GameTask a task of the game
 * @property {string} name
 * @property {'detection_response'|'take_over'|'secondary_task'} kind
 * @property {string} label
 * @property {string} seat vehicle of the driver that it is for
 * @property {number|null} shown_s longest time that a light is on, or a request after its lead
 * @property {number|null} latest_s until when a stimulus can be answered
 * @property {number|null} lead_s of a request
 * @property {boolean} show whether the driver reads the label
 *
 * @typedef {object} OpenPrompt a stimulus or request that is neither answered nor over
 * @property {string} task
 * @property {string} seat
 * @property {number} number
 * @property {number} n simulation step of its onset
 * @property {boolean} seen whether a page has shown it
 *
 * @typedef {{type: 'tasks', running: string[], open: OpenPrompt[]}} TasksMessage
 *
 * @typedef {object} PageTimes by this page's clock [ms]
 * @property {number} [response_ms]
 * @property {number} [delay_ms]
 * @property {number} [picture_ms]
 * @property {number} [paused_ms]
 *
 * @typedef {{type: 'task', seat: string, task: string, number: number,
 *   what: 'shown'|'answer'} & PageTimes} TaskReportMessage
 */

export {};
