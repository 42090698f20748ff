// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The participant's page, which shows the server's documents and sends the answers. */

import { element, part, setAttribute, setText } from '../../cockpit/js/dom.js';
import { isKey, newKey, session } from '../../cockpit/js/panels/memory.js';
import { breakView } from './break_view.js';
import { DeskConnection } from './desk_connection.js';
import { DeviceCheck } from './device_check.js';
import { Draft, draftName, forgetOtherDrafts } from './draft.js';
import { DriveFrame } from './drive_frame.js';
import { PadNavigation } from './pad_navigation.js';
import { button, pageNodes, pageView } from './page_view.js';
import { questionForm } from './question_form.js';
import { Words } from './words.js';

import type {
  DeskDocument, OverDocument, RefusedMessage, Told, WordsMessage,
} from './desk_messages.js';

const ANSWERED = ['questions', 'page', 'break', 'device'];
const PAGE_KEY = 'crgame.desk.page';

type Received = DeskDocument | WordsMessage | RefusedMessage;

class ParticipantPage {
  #words = new Words();
  #sheet = part(document.body, 'sheet');
  #lost = part(document.body, 'lost');
  #shown: DeskDocument | null = null;
  #check: DeviceCheck | null = null;
  // The message that was sent but not answered yet.
  #sent = '';
  #drive = new DriveFrame(part(document.body, 'drive'), this.#words,
    () => this.#connection.send({ type: 'ready', item: this.#shown?.item ?? '' }));
  #connection = new DeskConnection<Received>('/ws/participant', {
    opened: (again) => {
      this.#connection.send({ type: 'hello', page: pageKey(), fresh: !again });
      this.#sent = '';
      this.#lost.hidden = true;
    },
    lost: () => {
      this.#lost.hidden = this.#shown === null || this.#shown.show === 'over';
      setText(this.#lost, this.#words.of('lost'));
    },
    received: (message) => this.#receive(message),
    pinged: () => this.#stage(),
  });

  constructor() {
    new PadNavigation(this.#sheet, part(document.body, 'drive'));
  }

  #stage() {
    const { seated, input_delay_ms } = this.#drive.state;
    return { ...typeof seated === 'boolean' ? { seated } : {},
      ...Number.isFinite(input_delay_ms) ? { drive_delay_ms: input_delay_ms } : {} };
  }

  #receive(message: Received) {
    switch (message.type) {
      case 'words':
        this.#words.load(message.words, message.language);
        // Redraw the present content in the new words.
        if (this.#shown !== null) {
          this.#show(this.#shown, true);
        }
        break;
      case 'refused':
        this.#sent = '';
        this.#refuse(message.text);
        break;
      default:
        this.#show(message);
    }
  }

  #refuse(text: string) {
    this.#sheet.querySelector('.refused')?.remove();
    this.#sheet.append(element('p', { class: 'problem refused', role: 'alert',
      text: `${this.#words.of('refused')} ${text}` }));
  }

  /** @param anew also if the same is shown already */
  #show(shown: DeskDocument, anew = false) {
    const before = this.#shown;
    this.#shown = shown;
    document.documentElement.lang = shown.language;
    document.title = shown.study;
    document.body.dataset.show = shown.show;
    setText(part(document.body, 'study'), shown.study);
    this.#showProgress(shown);
    // A document without an item, as in an unused tab, may be followed by the same item again.
    if (shown.item !== '' || shown.show === 'over') {
      forgetOtherDrafts(draftName(shown));
    }
    if (shown.show === 'drive') {
      this.#clear();
      this.#drive.show(shown);
      return;
    }
    this.#drive.hide();
    // The same document again, because a page came or went: typed text stays.
    const same = !anew && before !== null && keyOf(before) === keyOf(shown);
    if (!same) {
      this.#sent = '';
      this.#clear();
      this.#sheet.append(this.#view(shown));
      window.scrollTo(0, 0);
      this.#focus(before !== null);
    }
  }

  #clear() {
    this.#check?.end();
    this.#check = null;
    this.#sheet.replaceChildren();
  }

  /** @param moved whether the person has just come from another item */
  #focus(moved: boolean) {
    const first = this.#sheet.querySelector('input:not([type=checkbox]), textarea');
    const fits = this.#sheet.scrollHeight <= window.innerHeight;
    // Never focus a button: a key that is still held would agree or continue without reading.
    const target = first instanceof HTMLElement && (fits || !moved) ? first : this.#sheet;
    target.focus({ preventScroll: true });
  }

  #showProgress({ progress }: DeskDocument) {
    const bar = part(document.body, 'progress');
    bar.hidden = progress === undefined;
    if (progress) {
      const { done, of } = progress;
      setText(part(document.body, 'step'), this.#words.of('step', {
        done: Math.min(done + 1, of), of }));
      setAttribute(bar, 'aria-valuenow', `${done}`);
      setAttribute(bar, 'aria-valuemax', `${of}`);
      part(document.body, 'progress-done').style.width = `${100 * done / of}%`;
    } else {
      setText(part(document.body, 'step'), '');
    }
  }

  #view(shown: Exclude<DeskDocument, { show: 'drive' }>): HTMLElement {
    const words = this.#words;
    // An item that the page waits for has not been shown yet.
    const draft = !ANSWERED.includes(shown.show) ? null
      : new Draft(draftName(shown), () => this.#connection.now_s);
    const finish = (told: Partial<Told>) => {
      if (draft && this.#sent !== shown.item) {
        this.#sent = this.#connection.send({ type: 'finish', item: shown.item, ...draft.times(),
          ...told }) ? shown.item : '';
      }
    };
    switch (shown.show) {
      case 'language':
        return this.#languages(shown.languages);
      case 'questions':
        return draft === null ? notice('', '') : questionForm(shown, words, draft, finish);
      case 'page':
        return pageView(shown, words, (agreed) => finish(agreed === undefined ? {} : { agreed }));
      case 'break':
        return breakView(shown, words, () => finish({}));
      case 'device':
        this.#check = new DeviceCheck(shown, words, finish);
        return this.#check.node;
      case 'over':
        return overView(shown, words);
      case 'wait':
        return notice(words.of('wait'), words.of(`wait_${shown.why}`, shown.link), true);
      default:
        return element('div', {}, notice(words.of('elsewhere'), words.of('elsewhere_text')),
          element('div', { class: 'go-on' }, button(words.of('here'), 'primary',
            () => this.#connection.send({ type: 'here' }))));
    }
  }

  #languages(languages: string[]) {
    return element('div', { class: 'languages' },
      element('h2', { text: this.#words.of('choose_language') }),
      ...languages.map((language) => {
        const name = new Intl.DisplayNames([language], { type: 'language' }).of(language);
        const choose = button(name ?? language, 'primary',
          () => this.#connection.send({ type: 'language', language }));
        choose.lang = language;
        return choose;
      }));
  }
}

function overView({ tree, how, code, address }: OverDocument, words: Words) {
  const told = tree.length > 0
    ? element('article', { class: 'reading', role: 'status' }, ...pageNodes(tree))
    : notice(words.of('thanks'), words.of(code === '' ? `over_${how}` : `over_${how}_code`));
  if (code !== '') {
    told.append(element('p', { class: 'code', text: words.of('code', { code }) }));
  }
  if (address !== '') {
    told.append(element('p', {}, element('a', { href: address, rel: 'noopener noreferrer',
      text: words.of('to_platform') })));
  }
  return told;
}

function notice(title: string, text: string, waits = false) {
  return element('div', { class: 'message', role: 'status' }, element('h2', { text: title }),
    element('p', { class: 'lead', text }),
    waits ? element('div', { class: 'waiting', 'aria-hidden': 'true' }) : null);
}

/** Return a key of the shown document that changes if another page has to be built. */
function keyOf(shown: DeskDocument) {
  return JSON.stringify({ ...shown, progress: null, left_s: 0 });
}

/** @returns the same as long as this tab lives */
function pageKey(): string {
  const kept = session.get(PAGE_KEY) ?? '';
  const key = isKey(kept) ? kept : newKey();
  session.set(PAGE_KEY, key);
  return key;
}

new ParticipantPage();
