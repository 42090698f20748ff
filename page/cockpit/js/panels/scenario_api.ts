// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Requests to the server about scenarios; every refusal becomes an Error with one line. */

import { oneLine } from './format.js';

import type { Choice, Offer, PlannerOption, Preview } from '../api_messages.js';
import type { Reply } from '../messages.js';

/**
 * Return the headers of requests that change something. A page of another site cannot add the
 * first; the other is this page's key, so that others see who did it.
 */
function own() {
  return { 'X-Crgame': '1', ...window.crgame?.person?.headers };
}

export function fetchScenarios(): Promise<Offer> {
  return ask('/api/scenarios');
}

/** `id` of an entry; `signal`: aborts it. */
export function fetchPreview(id: string, signal: AbortSignal): Promise<Preview> {
  return ask(`/api/preview?id=${encodeURIComponent(id)}`, { signal });
}

/** @param planner one of those that can be chosen */
export async function fetchPlannerOptions(planner: string): Promise<PlannerOption[]> {
  const { options } = await ask<{ options: PlannerOption[] }>(
    `/api/planner?name=${encodeURIComponent(planner)}`);
  return options;
}

/** Return the id of the entry of a CommonRoad file. */
export async function upload(file: File): Promise<string> {
  const reply = await ask<{ id: string }>(`/api/upload?name=${encodeURIComponent(file.name)}`, {
    method: 'POST', body: file, headers: { ...own(), 'Content-Type': 'application/xml' },
  });
  return reply.id;
}

export function deleteUpload(id: string): Promise<Reply> {
  return post('/api/upload/delete', { id });
}

/** Load a choice: id, humans [{id, driver}], avs [{id, planner, options}]; return what it did. */
export async function load(choice: Choice): Promise<string> {
  const reply = await post<Reply>('/api/load', choice);
  return oneLine(reply.text);
}

/**
 * Send the server JSON.
 * @returns as `ask`
 * @throws {Error} with one readable line
 */
export function post<Content>(path: string, content: unknown): Promise<Content> {
  return ask(path, { method: 'POST', body: JSON.stringify(content),
    headers: { ...own(), 'Content-Type': 'application/json' } });
}

/**
 * Ask the server for JSON.
 * @returns the server's answer, of the type of this path
 * @throws {Error} with one readable line
 */
export async function ask<Content>(path: string, options: RequestInit = {}): Promise<Content> {
  let response;
  try {
    response = await fetch(path, { credentials: 'same-origin', ...options });
  } catch (error) {
    if (error instanceof DOMException && error.name === 'AbortError') {
      throw error;
    }
    throw new Error('The server does not answer.', { cause: error });
  }
  const text = await response.text();
  let content;
  try {
    content = JSON.parse(text);
  } catch {
    // A refusal by the web server itself is plain text with the reason.
    content = { error: response.ok ? 'The server sent no JSON.' : text.slice(0, 200) };
  }
  if (!response.ok || content.error || content.ok === false) {
    throw new Error(oneLine(content.error || content.text || response.statusText)
      || `The server refused (${response.status}).`);
  }
  return content;
}
