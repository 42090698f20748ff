// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The result of a run, and in words: why it ended, its contacts, planners, timing and files. */

import { fetchScore, fileAddress, replayAddress, zipAddress } from '../after/run_api.js';
import { element } from '../dom.js';
import { clockTime, errorText, NONE, oneLine, plural } from './format.js';
import { TABLE_I, valueOf } from './timing.js';

import type { Scored } from '../after/score.js';
import type { Contact, Files, Recording, Scene, Status } from '../messages.js';
import type { Store } from '../store.js';

// Further entries of a kind are only counted.
const MOST_LISTED = 5;
const REPORT = 'report.html';

/** The result of a run. */
export interface Result {
  why: { title: string; text: string };
  stays: boolean;
  t: number; // [s]
  driven: boolean;
  contacts: (Contact & { part: string })[];
  departures: { vehicle: string; t: number }[];
  planners: { id: string; name: string; accepted: number; refused: number; fallbacks: number }[];
  figures: [name: string, text: string, explanation: string][];
  recording: Recording;
  files: Files | null;
  scored: Scored;
  mine: string | null; // the vehicle that this page drives
}

export function why({ reason, t, contacts = [] }: Status) {
  const after = clockTime(t);
  const over = (text: string) => ({ title: 'The run is over', text });
  const [kind, , vehicle] = (reason ?? '').split(' ');
  switch (kind) {
    case 'duration': return over(`Its duration of ${after} is over.`);
    case 'stop': return over(`It was stopped by hand after ${after}.`);
    case 'signal': return over(`It was ended at the terminal after ${after}.`);
    case 'drivability': {
      const hit = contacts.findLast((item) => [item.vehicle, item.with].includes(vehicle));
      return { title: hit === undefined ? 'Off the road' : 'Collision',
        text: `${vehicle} ${hit === undefined ? 'left the road'
          : `and ${hit.vehicle === vehicle ? hit.with : hit.vehicle} touched`} after ${after}, `
          + 'which ends this game.' };
    }
    case 'silence': return { title: 'The simulation is silent',
      text: `It was heard last at ${after}. The terminal may tell why.` };
    default: return over(`It ended after ${after}.`);
  }
}

export function table(facts: Result) {
  const rows = facts.driven ? [
    ['Contacts', listed(facts.contacts, (item) => `${item.vehicle} with ${item.with}`,
      (item) => item.part)],
    ['Off the road', listed(facts.departures, (item) => item.vehicle)],
  ] : [['Driven', 'no vehicle: traffic was alone']];
  for (const { id, name, accepted, refused, fallbacks } of facts.planners) {
    rows.push([`${id}${name ? ` · ${oneLine(name)}` : ''}`, [
      `${plural(accepted, 'plan')} accepted`, `${refused} refused`,
      plural(fallbacks, 'fallback')].join(', ')]);
  }
  return element('table', { class: 'figures' }, element('tbody', {}, ...rows.map(
    ([name, text]) => element('tr', {}, element('th', { scope: 'row', text: name }),
      element('td', { text })))));
}

/** Return the side of the contact and who could have avoided it, if the timing report says so. */
export function part(contact: Contact, files: Files | null) {
  const pair = [contact.vehicle, contact.with].sort().join();
  const named = files?.contacts?.find((item) => [item.vehicle, item.with].sort().join() === pair);
  return named === undefined ? ''
    : ` (${oneLine(named.side)} of ${named.vehicle}; could have avoided it: `
      + `${oneLine(named.avoidable_by)})`;
}

function listed<Item extends { t: number }>(items: Item[], name: (item: Item) => string,
  remark: (item: Item) => string = () => '') {
  if (items.length === 0) {
    return 'none';
  }
  const texts = items.slice(0, MOST_LISTED).map(
    (item) => `${name(item)} at ${clockTime(item.t)}${remark(item)}`);
  const more = items.length - texts.length;
  return [...texts, ...(more > 0 ? [`${more} more`] : [])].join('; ');
}

export function figures(items: Result['figures']) {
  return [element('details', {}, element('summary', { text: 'How it kept time (table I)' }),
    element('dl', { class: 'outcome-figures' }, ...items.map(
      ([name, text, explanation]) => element('div', { title: explanation },
        element('dt', { text: name }), element('dd', { text: text || NONE })))))];
}

/** Return the list of files to view and download. */
export function fileList({ files, recording, connected }: Result & { connected: boolean }) {
  if (recording?.state === 'failed') {
    return element('p', { class: 'field-error', text: oneLine(recording.text) });
  }
  if (files === null) {
    return null;
  }
  const { run, names, complete } = files;
  const closed = recording.state !== 'recording';
  return element('div', { class: 'outcome-files', 'data-complete': complete },
    element('span', { class: 'dim', text: 'Files in ' }), element('code', { text: files.folder }),
    element('ul', {}, ...!connected ? names.map((text) => element('li', { text }))
      : [names.includes(REPORT) ? link('Report', fileAddress(run, REPORT), false) : null,
        closed ? link('Replay of the whole run', replayAddress(run), false) : null,
        ...names.filter((name) => name !== REPORT && name.includes('.')).map(
          (name) => link(name, fileAddress(run, name), true)),
        closed ? link('Everything as ZIP', zipAddress(run), true) : null]),
    complete || !connected ? null : element('span', { class: 'dim', role: 'status',
      text: 'Scenario, timing report and report are being written …' }));
}

/** @param download instead of showing it in another tab */
function link(text: string, href: string, download: boolean) {
  return element('li', {}, element('a', { href, text, download, target: download ? null : '_blank',
    rel: 'noopener' }));
}

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
