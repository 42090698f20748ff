// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Messages that come and go over the world. */

import { element, setText } from '../dom.js';
import { oneLine } from './format.js';
import { icon } from './icons.js';

/** @import { NoticeLevel } from '../messages.js' */
/** @import { Store } from '../store.js' */

// How long a message stays [ms]; an error stays until it is closed or many have followed.
/** @type {Record<NoticeLevel, number>} */
const STAYS_MS = { info: 5000, warn: 9000, error: 0 };
const MOST = 4;

/**
 * Show the notices of the server and of the page's own parts.
 *
 * @param {HTMLElement} root #notices
 * @param {Store} store
 * @returns {{show: (level: NoticeLevel, text: string) => void}}
 */
export function createNotices(root, store) {
  /** @type {Map<string, Toast>} */
  const shown = new Map();
  /** @type {(level: NoticeLevel, text: string) => void} */
  const show = (level, text) => {
    const known = Object.hasOwn(STAYS_MS, level) ? level : 'info';
    const line = oneLine(text);
    const key = `${known} ${line}`;
    const toast = shown.get(key) ?? new Toast(known, line, () => shown.delete(key));
    if (!shown.has(key)) {
      shown.set(key, toast);
      root.append(toast.root);
      while (shown.size > MOST) {
        shown.values().next().value?.close();
      }
    }
    toast.again();
  };
  store.on('notice', (notice) => show(notice.level, notice.text));
  return { show };
}

class Toast {
  #times = 0;
  #timer = 0;
  #stays_ms;
  #closed;
  #count = element('span', { class: 'toast-count' });

  /**
   * @param {NoticeLevel} level
   * @param {string} text
   * @param {() => void} closed
   */
  constructor(level, text, closed) {
    this.#stays_ms = STAYS_MS[level];
    this.#closed = closed;
    this.root = element('div', {
      class: `toast toast-${level}`, role: level === 'error' ? 'alert' : 'status',
      on: { pointerenter: () => clearTimeout(this.#timer), pointerleave: () => this.#wait() },
    }, icon(level), element('span', { class: 'toast-text', text }), this.#count,
    element('button', {
      type: 'button', class: 'icon-button', 'aria-label': 'Close this message',
      on: { click: () => this.close() },
    }, icon('close')));
  }

  /** The same message once more: counted instead of repeated. */
  again() {
    this.#times += 1;
    setText(this.#count, this.#times > 1 ? `×${this.#times}` : '');
    this.#wait();
  }

  close() {
    clearTimeout(this.#timer);
    this.root.remove();
    this.#closed();
  }

  #wait() {
    clearTimeout(this.#timer);
    if (this.#stays_ms > 0) {
      this.#timer = setTimeout(() => this.close(), this.#stays_ms);
    }
  }
}
