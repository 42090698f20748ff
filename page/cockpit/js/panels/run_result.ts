// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The known result of a run, from its status, its files and its score. */

import { fetchScore } from '../after/run_api.js';
import { errorText } from './format.js';
import { part, why } from './outcome_card.js';
import { TABLE_I, valueOf } from './timing.js';

import type { Scored } from '../after/score.js';
import type { Files, Scene, Status } from '../messages.js';
import type { Result } from './outcome_card.js';
import type { Store } from '../store.js';

// Names of figures of table I for a run that is over.
const FINAL_NAMES: Record<string, string> = { final_error_ms: 'Lag at the end' };

/** The result; one per page. */
export class RunResult {
  #store;
  #changed;
  #files: Files | null = null;
  // The requested scores, by run.
  #scores = new Map<string, Scored>();

  /** @param changed called when files or a score have come */
  constructor(store: Store, changed: () => void) {
    this.#store = store;
    this.#changed = changed;
    store.on('files', (files) => {
      this.#files = files;
      changed();
    });
    store.on('connection', (connected) => {
      // The server may not have been there to ask.
      for (const [run, { state }] of connected ? this.#scores : []) {
        if (state === 'none') {
          this.#scores.delete(run);
        }
      }
    });
  }

  /** Remove the files of another program's run. */
  clearFiles() {
    this.#files = null;
  }

  /** Return the result. */
  of(status: Status, scene: Scene): Result {
    const over = status.run === 'ended';
    const files = over && this.#files?.epoch === status.epoch ? this.#files : null;
    const { timing } = status;
    return {
      scored: over ? this.#score(status, files)
        : { state: 'none', why: 'it is made when the run is over' },
      mine: this.#store.own[0] ?? null,
      why: why(status), stays: Boolean(status.stays), t: status.t,
      driven: scene.vehicles.length > 0,
      contacts: (status.contacts ?? []).map((item) => ({ ...item, part: part(item, files) })),
      departures: status.departures ?? [],
      planners: scene.vehicles.filter(({ role }) => role === 'autonomous').map(({ id }) => ({
        id, name: status.planners[id]?.planner || scene.planners?.[id] || '',
        accepted: status.planners[id]?.accepted ?? 0, refused: status.planners[id]?.refused ?? 0,
        fallbacks: status.planners[id]?.fallbacks ?? 0 })),
      figures: timing ? TABLE_I.map(([key, name, explanation, format]) => [
        (over && FINAL_NAMES[key]) || name, format(valueOf(timing, key)), explanation]) : [],
      recording: status.recording, files,
    };
  }

  /** Return the score of the run, once its recording is closed and the server has sent it. */
  #score({ recording }: Status, files: Files | null): Scored {
    if (files === null || recording.state === 'recording') {
      return recording.state === 'none' ? { state: 'none', why: 'nothing was recorded' }
        : { state: 'waiting' };
    }
    const known = this.#scores.get(files.run);
    if (known !== undefined) {
      return known;
    }
    this.#scores.set(files.run, { state: 'waiting' });
    fetchScore(files.run).then(
      (score) => this.#scores.set(files.run, { state: 'told', score }),
      (error) => this.#scores.set(files.run, { state: 'none', why: errorText(error) }),
    ).then(() => this.#changed());
    return { state: 'waiting' };
  }
}
