// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * Types of the messages about tasks between the page and its server: no code here.
 *
 * The server's side is crgame_ros/cockpit/scene.py, crgame_ros/game/task_documents.py and, for
 * the page's messages, crgame_ros/cockpit/page_messages.py.
 */

import type { TaskDone } from '../page_messages.js';

export interface GameTask {
  name: string;
  kind: 'detection_response' | 'take_over' | 'secondary_task';
  label: string;
  seat: string; // vehicle of the driver that it is for
  shown_s: number | null; // longest time that a light is on, or a request after its lead
  latest_s: number | null; // until when a stimulus can be answered
  lead_s: number | null; // of a request
  show: boolean; // whether the driver reads the label
  key: string | null; // place of the key that answers it; null for a secondary task
  button: number | null; // of a gamepad or wheel; null for the usual ones
}

/** A stimulus or request that is neither answered nor over. */
export interface OpenPrompt {
  task: string;
  seat: string;
  number: number;
  n: number; // simulation step of its onset
  seen: boolean; // whether a page has shown it
}

export interface TasksMessage { type: 'tasks'; running: string[]; open: OpenPrompt[] }

/** By this page's clock [ms]; `steady_s` of the first picture by the server's steady clock [s]. */
export type PageTimes = {
  [Time in Exclude<keyof TaskDone, 'type' | 'seat' | 'task' | 'number' | 'what'>]?: number };
