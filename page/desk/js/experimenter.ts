// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The experimenter's page, which shows the session's state and sends orders. */

import { element, part, setAttribute, setText } from '../../cockpit/js/dom.js';
import { DeskConnection } from './desk_connection.js';
import { entryWords, timeOfDay } from './log_words.js';
import { stageAddress } from './drive_frame.js';
import { askReason } from './reason_dialog.js';

import type { ReplyMessage } from '../../cockpit/js/messages.js';
import type { ExperimenterDocument, ItemRow } from './experimenter_messages.js';
import type { ExperimenterMessage, Unnumbered } from './page_messages.js';

// After such a pause the experimenter is told: what was practised may be forgotten [h].
const LONG_PAUSE_H = 6;
const MARKER_KEYS = ['F1', 'F2', 'F3', 'F4', 'F5', 'F6', 'F7', 'F8', 'F9'];

type Received = ExperimenterDocument | ReplyMessage;

/** The whole page. */
class ExperimenterPage {
  #shown: ExperimenterDocument | null = null;
  #lastId = 0;
  #answer = part(document.body, 'answer');
  #connection = new DeskConnection<Received>('/ws/experimenter', {
    opened: () => {
      part(document.body, 'lost').hidden = true;
    },
    lost: () => {
      const lost = part(document.body, 'lost');
      lost.hidden = false;
      setText(lost, this.#shown?.over ? 'The session is over, and the program has ended.'
        : 'The connection is lost. It comes back by itself; the session goes on meanwhile. '
          + 'If the program was ended, start it again.');
    },
    received: (message) => this.#receive(message),
  });

  #orders: Record<'hold' | 'skip' | 'abort' | 'end', HTMLButtonElement> = {
    hold: order('', () => this.#send({ type: 'hold', held: !this.#shown?.held })),
    abort: order('Abort the drive', () => this.#reasoned('abort', 'Abort the drive',
      'It counts for nothing, and comes again.')),
    skip: order('Skip this item', () => this.#reasoned('skip', 'Skip this item',
      'It is left out of this session.')),
    end: order('End the session', () => this.#end()),
  };

  constructor() {
    part(document.body, 'watch').addEventListener('toggle', () => this.#showDrive());
    part(document.body, 'orders').append(...Object.values(this.#orders));
    this.#orders.end.classList.add('danger');
    const note = part(document.body, 'note') as HTMLTextAreaElement;
    const keep = () => {
      if (note.value.trim() && this.#send({ type: 'note', text: note.value })) {
        note.value = '';
      }
    };
    part(document.body, 'note-form').addEventListener('submit', (event) => {
      event.preventDefault();
      keep();
    });
    note.addEventListener('keydown', (event) => {
      if (event.key === 'Enter' && (event.ctrlKey || event.metaKey)) {
        event.preventDefault();
        keep();
      }
    });
    window.addEventListener('keydown', (event) => {
      const name = this.#shown?.markers[MARKER_KEYS.indexOf(event.key)];
      if (name !== undefined && !event.repeat) {
        event.preventDefault();
        this.#send({ type: 'mark', name });
      }
    });
  }

  #send(message: Unnumbered<ExperimenterMessage>) {
    this.#lastId += 1;
    const sent = this.#connection.send({ ...message, id: this.#lastId });
    if (!sent) {
      this.#showAnswer('There is no connection.', true);
    }
    return sent;
  }

  #showAnswer(text: string, bad: boolean) {
    setText(this.#answer, text);
    setAttribute(this.#answer, 'data-bad', bad);
  }

  #receive(message: Received) {
    if (message.type === 'reply') {
      this.#showAnswer(message.ok ? 'Kept.' : message.text, !message.ok);
    } else if (message.type === 'desk') {
      this.#show(message);
    }
  }

  async #reasoned(type: 'skip' | 'abort', title: string, text: string) {
    const item = this.#shown?.item ?? '';
    const reason = await askReason(`${title}: ${item}`, text, title);
    if (reason !== null) {
      this.#send({ type, item, reason });
    }
  }

  async #end() {
    const reason = await askReason('End the session?',
      'Nothing more is asked or driven in it, also after a new start.', 'Go on');
    if (reason !== null && await askReason('Really end it?', `Reason: ${reason}`,
      'End the session', false) !== null) {
      this.#send({ type: 'end', reason });
    }
  }

  async #repeat({ id, kind }: ItemRow) {
    const reason = await askReason(`Repeat ${kind}`,
      `${id} comes again now; what was told before stays in the journal.`, 'Repeat');
    if (reason !== null) {
      this.#send({ type: 'repeat', item: id, reason });
    }
  }

  #show(shown: ExperimenterDocument) {
    this.#shown = shown;
    document.title = `${shown.participant}: ${shown.study}`;
    setText(part(document.body, 'study'), shown.study);
    setText(part(document.body, 'who'), `Participant ${shown.participant}, place `
      + `${shown.place + 1}${shown.group ? `, group ${shown.group}` : ''}`
      + `${shown.language ? `, language ${shown.language}` : ''}`);
    this.#showPage(shown);
    this.#showNow(shown);
    this.#showDrive();
    this.#showMarkers(shown.markers);
    this.#showItems(shown.items);
    this.#showLog(shown);
  }

  #showPage({ page }: ExperimenterDocument) {
    const node = part(document.body, 'page');
    const delay = page.round_trip_ms === undefined ? ''
      : `, round trip ${Math.round(page.round_trip_ms)} ms`;
    const drive = page.drive_delay_ms === undefined ? ''
      : `, input latency ${Math.round(page.drive_delay_ms)} ms`;
    const more = page.open > 1 ? `, ${page.open} tabs` : '';
    const silent = page.silent_s === undefined ? ''
      : `, but silent for ${page.silent_s} s: it is frozen, or hidden`;
    setText(node, page.connected ? `Participant's page: connected${silent}${delay}${drive}${more}`
      : "Participant's page: not connected");
    node.dataset.connected = String(page.connected && page.silent_s === undefined);
  }

  #showNow(shown: ExperimenterDocument) {
    const { drive, over } = shown;
    const row = shown.items.find(({ id }) => id === shown.item);
    setText(part(document.body, 'now-title'), over
      ? { done: 'The session is done', declined: 'Consent was not given: the session is over',
        excluded: 'The participant is excluded: the session is over',
        ended: 'The session was ended' }[over]
      : `Now: ${row?.kind ?? ''}${row?.condition ? `, ${row.condition}` : ''} (${shown.item})`);
    const lines = [];
    if (drive.phase !== 'none') {
      const clock = drive.time_s === null ? '' : `, ${drive.time_s.toFixed(1)} s`;
      lines.push(`Drive ${drive.item}: ${drive.phase}${clock}`
        + `${drive.attempt > 1 ? `, attempt ${drive.attempt}` : ''}`);
    }
    if (drive.text) {
      lines.push(drive.text);
    }
    lines.push(...drive.doubts.map((doubt) => `Data in doubt: ${doubt}`));
    if (shown.page.error) {
      lines.push(shown.page.error);
    }
    if (shown.pause_h >= LONG_PAUSE_H && !over) {
      lines.push(`The session goes on after ${Math.round(shown.pause_h)} hours. `
        + 'Practice can be repeated in the list below.');
    }
    if (shown.ending && !over) {
      lines.push('The session ends as soon as the drive is over.');
    } else if (shown.waits) {
      lines.push('Held: the participant waits.');
    } else if (shown.held) {
      lines.push('It will be held before the next item.');
    }
    setText(part(document.body, 'now-text'), lines.join('\n'));
    setAttribute(part(document.body, 'now'), 'data-alarm',
      drive.phase === 'failed' || drive.doubts.length > 0 || Boolean(shown.page.error));
    setText(this.#orders.hold, shown.held ? 'Go on' : 'Hold before the next item');
    setAttribute(this.#orders.hold, 'disabled', Boolean(over));
    setAttribute(this.#orders.abort, 'disabled', !shown.can_abort);
    setAttribute(this.#orders.skip, 'disabled', Boolean(over) || shown.can_abort);
    setAttribute(this.#orders.end, 'disabled', Boolean(over || shown.ending));
  }

  /** Show the drive in a small frame while it is opened; closed, it costs nothing. */
  #showDrive() {
    const node = part(document.body, 'watch') as HTMLDetailsElement;
    const link = stageAddress(this.#shown?.drive.watch ?? '', window.location)?.href ?? '';
    node.hidden = link === '';
    const frame = node.querySelector('iframe');
    const wanted = node.open ? link : '';
    if ((frame?.src ?? '') !== wanted) {
      frame?.remove();
      if (wanted !== '') {
        node.append(element('iframe', { src: wanted, title: 'The drive', tabindex: '-1' }));
      }
    }
  }

  #showMarkers(markers: string[]) {
    const node = part(document.body, 'markers');
    const key = markers.join('\n');
    if (node.dataset.key !== key) {
      node.dataset.key = key;
      node.replaceChildren(...markers.map((name, i) => {
        const press = order(name, () => this.#send({ type: 'mark', name }));
        if (MARKER_KEYS[i]) {
          press.append(element('kbd', { text: MARKER_KEYS[i] }));
        }
        return press;
      }));
    }
  }

  #showItems(rows: ItemRow[]) {
    const body = part(document.body, 'items');
    const key = JSON.stringify(rows);
    if (body.dataset.key === key) {
      return;
    }
    body.dataset.key = key;
    body.replaceChildren(...rows.map((row) => {
      const done = row.state === 'finished' || row.state === 'skipped';
      const repeat = done ? order('Repeat', () => this.#repeat(row)) : null;
      repeat?.setAttribute('aria-label', `Repeat ${row.id}`);
      return element('tr', { 'data-state': row.state,
        'aria-current': row.state === 'now' ? 'step' : null },
      element('th', { scope: 'row', text: row.id }), element('td', { text: row.kind }),
      element('td', { text: row.condition }),
      element('td', { text: row.outcome ? `${row.state}: ${row.outcome}` : row.state }),
      element('td', { text: row.attempts ? `${row.attempts}` : '' }),
      element('td', {}, repeat));
    }));
    // The list follows the session, but stays where the experimenter has scrolled it meanwhile.
    const now = body.querySelector<HTMLElement>('[aria-current]');
    const box = body.closest<HTMLElement>('.scrolled');
    if (now && box && body.dataset.now !== now.textContent) {
      body.dataset.now = now.textContent ?? '';
      box.scrollTop = now.offsetTop - box.clientHeight / 3;
    }
  }

  #showLog({ log }: ExperimenterDocument) {
    const node = part(document.body, 'log');
    const key = `${log.length} ${log.at(-1)?.at}`;
    if (node.dataset.key !== key) {
      node.dataset.key = key;
      node.replaceChildren(...log.toReversed().map((entry) => element('li', {},
        element('time', { text: timeOfDay(entry.at) }), entryWords(entry))));
    }
  }
}

function order(text: string, act: () => void) {
  return element('button', { type: 'button', text, on: { click: act } });
}

new ExperimenterPage();
