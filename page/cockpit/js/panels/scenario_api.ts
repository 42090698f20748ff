// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Requests to the server about scenarios; every refusal becomes an Error with one line. */

import { oneLine } from './format.js';

/** @import { Choice, Offer, PlannerOption, Preview } from '../messages.js' */

/** Header of all requests that change something: a page of another site cannot add it. */
export const OWN = { 'X-Crgame': '1' };

/** Return the header with this page's key, so that others see who did it. */
function own() {
  return { ...OWN, ...window.crgame?.person?.headers };
}

/** @returns {Promise<Offer>} */
export function fetchScenarios() {
  return ask('/api/scenarios');
}

/**
 * @param {string} id of an entry
 * @param {AbortSignal} signal aborts it
 * @returns {Promise<Preview>}
 */
export function fetchPreview(id, signal) {
  return ask(`/api/preview?id=${encodeURIComponent(id)}`, { signal });
}

/**
 * @param {string} planner one of those that can be chosen
 * @returns {Promise<PlannerOption[]>}
 */
export async function fetchPlannerOptions(planner) {
  return (await ask(`/api/planner?name=${encodeURIComponent(planner)}`)).options;
}

/**
 * @param {File} file a CommonRoad file
 * @returns {Promise<string>} id of its entry
 */
export async function upload(file) {
  const reply = await ask(`/api/upload?name=${encodeURIComponent(file.name)}`, {
    method: 'POST', body: file, headers: { ...own(), 'Content-Type': 'application/xml' },
  });
  return reply.id;
}

/**
 * @param {string} id of an upload
 * @returns {Promise<string>} what was done
 */
export async function deleteUpload(id) {
  const reply = await ask('/api/upload/delete', {
    method: 'POST', body: JSON.stringify({ id }),
    headers: { ...OWN, 'Content-Type': 'application/json' },
  });
  return oneLine(reply.text);
}

/**
 * @param {Choice} choice id, humans [{id, driver}], avs [{id, planner, options}]
 * @returns {Promise<string>} what was done
 */
export async function load(choice) {
  const reply = await ask('/api/load', {
    method: 'POST', body: JSON.stringify(choice),
    headers: { ...own(), 'Content-Type': 'application/json' },
  });
  return oneLine(reply.text);
}

/**
 * Ask the server for JSON.
 *
 * @param {string} path
 * @param {RequestInit} [options]
 * @returns {Promise<any>} the server's answer, of the type of this path
 * @throws {Error} with one readable line
 */
export async function ask(path, options = {}) {
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
