// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The experimenter's page, which shows the session's state and sends orders. */

import { element, part, setAttribute, setText } from '../../cockpit/js/dom.js';
import { local } from '../../cockpit/js/panels/memory.js';
import { DeskConnection } from './desk_connection.js';
import { stageAddress } from './drive_frame.js';
import { askReason } from './reason_dialog.js';
import { doubtWords, entryWords, kindWords, stateWords, timeOfDay } from './session_words.js';
import { Words } from './words.js';

import type { ReplyMessage } from '../../cockpit/js/messages.js';
import type { ExperimenterDocument, ExperimenterWords, ItemRow } from './experimenter_messages.js';
import type { ExperimenterMessage, Unnumbered } from './page_messages.js';

// After such a pause the experimenter is told: what was practised may be forgotten [h].
const LONG_PAUSE_H = 6;
const MARKER_KEYS = ['F1', 'F2', 'F3', 'F4', 'F5', 'F6', 'F7', 'F8', 'F9'];
const LANGUAGE_KEY = 'crgame.desk.language';

type Received = ExperimenterDocument | ExperimenterWords | ReplyMessage;

class ExperimenterPage {
  #words = new Words();
  #language = '';
  #shown: ExperimenterDocument | null = null;
  #lastId = 0;
  #answer = part(document.body, 'answer');
  #connection = new DeskConnection<Received>('/ws/experimenter', {
    opened: () => {
      part(document.body, 'lost').hidden = true;
      this.#ask(local.get(LANGUAGE_KEY) ?? navigator.language.split('-')[0]);
    },
    lost: () => {
      const lost = part(document.body, 'lost');
      lost.hidden = this.#language === '';
      setText(lost, this.#words.of(this.#shown?.over ? 'desk_ended' : 'desk_lost'));
    },
    received: (message) => this.#receive(message),
  });

  #orders: Record<'hold' | 'skip' | 'abort' | 'end', HTMLButtonElement> = {
    hold: order('', () => this.#send({ type: 'hold', held: !this.#shown?.held })),
    abort: order('', () => this.#reasoned('abort')),
    skip: order('', () => this.#reasoned('skip')),
    end: order('', () => this.#end()),
  };

  constructor() {
    part(document.body, 'watch').addEventListener('toggle', () => this.#showDrive());
    part(document.body, 'orders').append(...Object.values(this.#orders));
    this.#orders.end.classList.add('danger');
    for (const name of ['abort', 'skip', 'end'] as const) {
      this.#orders[name].dataset.word = `desk_${name}`;
    }
    const language = part(document.body, 'language') as HTMLSelectElement;
    language.addEventListener('change', () => {
      local.set(LANGUAGE_KEY, language.value);
      this.#ask(language.value);
    });
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

  /** Ask for the words in a language. */
  #ask(language: string) {
    this.#connection.send({ type: 'language', language: language.slice(0, 20) });
  }

  #send(message: Unnumbered<ExperimenterMessage>) {
    this.#lastId += 1;
    const sent = this.#connection.send({ ...message, id: this.#lastId });
    if (!sent) {
      this.#showAnswer(this.#words.of('desk_offline'), true);
    }
    return sent;
  }

  #showAnswer(text: string, bad: boolean) {
    setText(this.#answer, text);
    setAttribute(this.#answer, 'data-bad', bad);
  }

  #receive(message: Received) {
    if (message.type === 'reply') {
      this.#showAnswer(message.ok ? this.#words.of('desk_kept')
        : this.#words.of('desk_refused', { text: message.text }), !message.ok);
    } else if (message.type === 'words') {
      this.#word(message);
    } else if (message.type === 'desk') {
      this.#shown = message;
      this.#show();
    }
  }

  #word({ words, language, languages }: ExperimenterWords) {
    this.#words.load(words, language);
    this.#language = language;
    document.documentElement.lang = language;
    for (const node of document.querySelectorAll<HTMLElement>('[data-word]')) {
      setText(node, this.#words.of(node.dataset.word ?? ''));
    }
    const choice = part(document.body, 'language') as HTMLSelectElement;
    choice.setAttribute('aria-label', this.#words.of('desk_language'));
    choice.replaceChildren(...languages.map((code) => element('option', { value: code, lang: code,
      selected: code === language,
      text: new Intl.DisplayNames([code], { type: 'language' }).of(code) ?? code })));
    this.#showAnswer('', false);
    this.#show();
  }

  async #reasoned(type: 'skip' | 'abort') {
    const item = this.#shown?.item ?? '';
    const title = this.#words.of(`desk_${type}`);
    const reason = await askReason(this.#words, `${title}: ${item}`,
      this.#words.of(`desk_${type}_text`), title);
    if (reason !== null) {
      this.#send({ type, item, reason });
    }
  }

  async #end() {
    const words = this.#words;
    const reason = await askReason(words, words.of('desk_end_ask'), words.of('desk_end_text'),
      words.of('desk_end_go_on'));
    if (reason !== null && await askReason(words, words.of('desk_end_sure'),
      words.of('desk_end_reason', { reason }), words.of('desk_end'), false) !== null) {
      this.#send({ type: 'end', reason });
    }
  }

  async #repeat(row: ItemRow) {
    const words = this.#words;
    const reason = await askReason(words,
      words.of('desk_repeat_of', { what: kindWords(row, words) }),
      words.of('desk_repeat_text', { item: row.id }), words.of('desk_repeat'));
    if (reason !== null) {
      this.#send({ type: 'repeat', item: row.id, reason });
    }
  }

  /** Show the session as soon as it and the page's words are known. */
  #show() {
    const shown = this.#shown;
    if (shown === null || this.#language === '') {
      return;
    }
    const { study, participant, place, group, partners, language } = shown;
    document.title = this.#words.of('desk_title', { participant, study });
    setText(part(document.body, 'study'), study);
    setText(part(document.body, 'who'), [
      this.#words.of('desk_who', { participant, place: place + 1 }),
      ...group ? [this.#words.of('desk_group', { group })] : [],
      ...partners.length === 0 ? []
        : [this.#words.of('desk_partners', { partners: partners.join(', ') })],
      ...language ? [this.#words.of('desk_participant_language', { language })] : []].join(', '));
    this.#showPage(shown);
    this.#showNow(shown);
    this.#showDrive();
    this.#showMarkers(shown.markers);
    this.#showItems(shown.items);
    this.#showLog(shown);
  }

  #showPage({ page }: ExperimenterDocument) {
    const node = part(document.body, 'page');
    const words = this.#words;
    const state = [words.of(page.connected ? 'desk_page_connected' : 'desk_page_gone')];
    if (page.connected) {
      const { silent_s, round_trip_ms, drive_delay_ms, open } = page;
      state.push(
        ...silent_s === undefined ? [] : [words.of('desk_page_silent', { seconds: silent_s })],
        ...round_trip_ms === undefined ? []
          : [words.of('desk_page_round_trip', { ms: Math.round(round_trip_ms) })],
        ...drive_delay_ms === undefined ? []
          : [words.of('desk_page_delay', { ms: Math.round(drive_delay_ms) })],
        ...open > 1 ? [words.of('desk_page_tabs', { count: open })] : []);
    }
    setText(node, words.of('desk_page', { state: state.join(', ') }));
    node.dataset.connected = String(page.connected && page.silent_s === undefined);
  }

  #showNow(shown: ExperimenterDocument) {
    const { drive, over } = shown;
    const words = this.#words;
    const row = shown.items.find(({ id }) => id === shown.item);
    setText(part(document.body, 'now-title'), over ? words.of(`desk_over_${over}`)
      : words.of('desk_now', { item: shown.item, what: row === undefined ? ''
        : [kindWords(row, words), ...row.condition ? [row.condition] : []].join(', ') }));
    const lines = [];
    if (drive.phase !== 'none') {
      lines.push([
        words.of('desk_drive', { item: drive.item, phase: words.of(`phase_${drive.phase}`) }),
        ...drive.time_s === null ? []
          : [words.of('desk_seconds', { seconds: words.number(drive.time_s, 1) })],
        ...drive.attempt > 1 ? [words.of('desk_attempt', { attempt: drive.attempt })] : [],
        ...drive.awaits_others ? [words.of('desk_awaits_others')] : [],
      ].join(', '));
    }
    const work = drive.work ? words.of(`work_${drive.work}`) : '';
    lines.push(...work || drive.text ? [[work, drive.text].filter(Boolean).join(': ')] : [],
      ...drive.doubts.map((doubt) => words.of('desk_doubt', { doubt: doubtWords(doubt, words) })));
    if (shown.page.error) {
      lines.push(shown.page.error);
    }
    if (shown.pause_h >= LONG_PAUSE_H && !over) {
      lines.push(words.of('desk_pause', { hours: Math.round(shown.pause_h) }));
    }
    if (shown.ending && !over) {
      lines.push(words.of('desk_ending'));
    } else if (shown.waits) {
      lines.push(words.of('desk_waits'));
    } else if (shown.held) {
      lines.push(words.of('desk_holds'));
    }
    setText(part(document.body, 'now-text'), lines.join('\n'));
    setAttribute(part(document.body, 'now'), 'data-alarm',
      drive.phase === 'failed' || drive.doubts.length > 0 || Boolean(shown.page.error));
    setText(this.#orders.hold, words.of(shown.held ? 'desk_release' : 'desk_hold'));
    setAttribute(this.#orders.hold, 'disabled', Boolean(over));
    setAttribute(this.#orders.abort, 'disabled', !shown.can_abort);
    setAttribute(this.#orders.skip, 'disabled', Boolean(over) || shown.can_abort);
    setAttribute(this.#orders.end, 'disabled', Boolean(over || shown.ending));
  }

  /** Show the drive in a small frame while it is opened, and where the experimenter drives. */
  #showDrive() {
    const node = part(document.body, 'watch') as HTMLDetailsElement;
    const link = stageAddress(this.#shown?.drive.watch ?? '', window.location)?.href ?? '';
    node.hidden = link === '';
    const frame = node.querySelector('iframe');
    const wanted = node.open ? link : '';
    if ((frame?.src ?? '') !== wanted) {
      frame?.remove();
      if (wanted !== '') {
        node.append(element('iframe', { src: wanted, tabindex: '-1' }));
      }
    }
    node.querySelector('iframe')?.setAttribute('title', this.#words.of('desk_watch_frame'));
    const own = part(document.body, 'confederate') as HTMLAnchorElement;
    const address = stageAddress(this.#shown?.drive.confederate ?? '', window.location);
    own.hidden = address === null;
    own.href = address?.href ?? '';
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
    const words = this.#words;
    const key = `${this.#language} ${JSON.stringify(rows)}`;
    if (body.dataset.key === key) {
      return;
    }
    body.dataset.key = key;
    body.replaceChildren(...rows.map((row) => {
      const done = row.state === 'finished' || row.state === 'skipped';
      const repeat = done ? order(words.of('desk_repeat'), () => this.#repeat(row)) : null;
      repeat?.setAttribute('aria-label', words.of('desk_repeat_of', { what: row.id }));
      return element('tr', { 'data-state': row.state,
        'aria-current': row.state === 'now' ? 'step' : null },
      element('th', { scope: 'row', text: row.id }),
      element('td', { text: kindWords(row, words) }),
      element('td', { text: row.condition }),
      element('td', { text: stateWords(row, words) }),
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
    const key = `${this.#language} ${log.length} ${log.at(-1)?.at}`;
    if (node.dataset.key !== key) {
      node.dataset.key = key;
      node.replaceChildren(...log.toReversed().map((entry) => element('li', {},
        element('time', { text: timeOfDay(entry.at) }), entryWords(entry, this.#words))));
    }
  }
}

function order(text: string, act: () => void) {
  return element('button', { type: 'button', text, on: { click: act } });
}

new ExperimenterPage();
