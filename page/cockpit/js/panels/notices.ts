// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Messages that come and go over the world. */

import { element, setText } from '../dom.js';
import { oneLine } from './format.js';
import { icon } from './icons.js';

import type { NoticeLevel } from '../messages.js';
import type { Store } from '../store.js';

// How long a message stays [ms]; an error stays until it is closed or many have followed.
const STAYS_MS: Record<NoticeLevel, number> = { info: 5000, warn: 9000, error: 0 };
const MOST = 4;

/** Show the notices of the server and of the page's own parts. */
export function createNotices(root: HTMLElement,
  store: Store): { show: (level: NoticeLevel, text: string) => void } {
  const shown = new Map<string, Toast>();
  const show = (level: NoticeLevel, text: string) => {
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
  root;

  constructor(level: NoticeLevel, text: string, closed: () => void) {
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
