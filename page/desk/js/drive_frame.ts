// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The cockpit's stage inside the participant's page, and the gate before each drive. */

import { element, setAttribute, setText } from '../../cockpit/js/dom.js';
import { keptProfiles } from '../../cockpit/js/driving/gamepad_profile.js';
import { button } from './page_view.js';

import type { DriveDocument } from './desk_messages.js';
import type { Words } from './words.js';
import type { StageState } from '../../cockpit/js/stage/stage_messages.js';


const LOOPBACK = ['127.0.0.1', 'localhost'];

/** The frame and the gate over it. */
export class DriveFrame {
  #root;
  #words;
  #ready;
  #frame: HTMLIFrameElement | null = null;
  #link = '';
  #address: URL | null = null; // of the link, if it has a page
  #phase = '';
  #pressed = false;
  #awaitsOthers = false;
  #state: Partial<StageState> = {};
  #title = element('h2');
  #text = element('p', { class: 'lead' });
  #status = element('p', { role: 'status' });
  #button;
  #gate;

  /**
   * @param root the element that fills the page during a drive
   * @param ready told that the participant is ready
   */
  constructor(root: HTMLElement, words: Words, ready: () => void) {
    this.#root = root;
    this.#words = words;
    this.#ready = ready;
    this.#button = button('', 'primary', () => this.#press());
    this.#gate = element('section', { class: 'gate', 'aria-live': 'polite' }, this.#title,
      this.#text, this.#status, element('div', { class: 'go-on' }, this.#button));
    root.append(this.#gate);
    window.addEventListener('message', (event) => this.#hear(event));
  }

  /** The last state from the stage; empty before the first. */
  get state() {
    return this.#state;
  }

  show(shown: DriveDocument) {
    const entered = shown.phase !== this.#phase || this.#root.hidden;
    this.#root.hidden = false;
    this.#load(shown.link);
    this.#phase = shown.phase;
    this.#pressed &&= shown.phase === 'ready' && !entered;
    this.#awaitsOthers = shown.awaits_others;
    setText(this.#title, titleOf(shown, this.#words));
    setText(this.#text, this.#words.of(
      shown.phase === 'ended' ? 'ended_text' : shown.awaits_others ? 'others_text'
        : shown.attempt > 1 && !shown.practice ? 'again_text' : 'ready_text'));
    this.#showGate();
    if (entered && shown.phase === 'ready' && !this.#button.disabled) {
      this.#button.focus();
    } else if (entered && shown.phase !== 'ready') {
      this.#focusFrame();
    }
  }

  /** Hide it behind other content; the stage stays loaded. */
  hide() {
    this.#root.hidden = true;
    this.#phase = '';
  }

  #showGate() {
    const ready = this.#phase === 'ready';
    // Without a stage the page does not wait.
    const { seated, rides, connected, drawn } = this.#state;
    const loaded = this.#link === '' || Boolean((seated || rides) && connected && drawn);
    const was = this.#button.disabled;
    this.#gate.hidden = !ready;
    setText(this.#button, this.#words.of('ready'));
    setText(this.#status, ready && !loaded ? this.#words.of('loading') : '');
    setAttribute(this.#button, 'disabled', !loaded);
    // After a reload the stage has to be told again.
    this.#button.hidden = this.#pressed && this.#awaitsOthers;
    if (this.#frame) {
      // Who waits for others keeps the focus there, with the hands at the controls.
      this.#frame.inert = ready && !this.#pressed;
      // Before it has a seat and its first picture, the stage shows parts of an incomplete page.
      this.#frame.classList.toggle('loads', ready && !loaded);
    }
    if (ready && was && loaded) {
      this.#button.focus();
    }
  }

  #press() {
    if (this.#phase !== 'ready') {
      return;
    }
    this.#pressed = true;
    this.#ready();
    this.#post({ kind: 'calibrations', profiles: keptProfiles() });
    this.#post({ kind: 'ready', ready: true });
    this.#focusFrame();
  }

  #focusFrame() {
    if (this.#frame) {
      this.#frame.inert = false;
      this.#frame.focus();
      this.#post({ kind: 'focus' });
    }
  }

  #load(link: string) {
    if (link === this.#link) {
      return;
    }
    this.#link = link;
    this.#state = {};
    this.#frame?.remove();
    this.#frame = null;
    this.#address = stageAddress(link, window.location);
    if (this.#address !== null) {
      this.#frame = element('iframe', { src: this.#address.href,
        title: this.#title.textContent || 'drive', allow: 'gamepad; fullscreen; autoplay' });
      this.#root.prepend(this.#frame);
    }
  }

  #post(message: Record<string, unknown>) {
    if (this.#address !== null) {
      this.#frame?.contentWindow?.postMessage({ crgame: 1, ...message }, this.#address.origin);
    }
  }

  #hear(event: MessageEvent) {
    if (this.#address === null || event.origin !== this.#address.origin
        || event.source !== this.#frame?.contentWindow) {
      return;
    }
    const { data } = event;
    if (data?.crgame === 1 && data.kind === 'stage' && typeof data.state === 'object') {
      if (this.#state.seat === undefined) {
        this.#post({ kind: 'calibrations', profiles: keptProfiles() });
      }
      this.#state = data.state ?? {};
      if (!this.#root.hidden) {
        this.#showGate();
      }
    }
  }
}

/**
 * Return the stage's address with this page's host name, because cookies belong to one host.
 * @param location of this page
 * @returns null if the link is not a page's address
 */
export function stageAddress(link: string, location: { hostname: string }): URL | null {
  if (!URL.canParse(link)) {
    return null;
  }
  const url = new URL(link);
  if (!['http:', 'https:'].includes(url.protocol)) {
    return null;
  }
  if (LOOPBACK.includes(url.hostname) && LOOPBACK.includes(location.hostname)) {
    url.hostname = location.hostname;
  }
  return url;
}

function titleOf({ practice, number, progress }: DriveDocument, words: Words) {
  return practice ? words.of('practice', { number })
    : words.of('drive', { number, of: progress?.drives ?? number });
}
