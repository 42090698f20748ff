// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The check whether the driver's inputs can act on this page right now. */

import type { Store } from '../store.js';

const EDITABLE = 'input:not([type=checkbox]):not([type=radio]):not([type=button]),'
  + 'select, textarea, [contenteditable=""], [contenteditable=true]';

/** Return whether an element uses the keys that are pressed at it. */
export function isTyping(target: EventTarget | null): boolean {
  return target instanceof Element && target.closest(EDITABLE) !== null;
}

/** Return whether a key may be a command: not with a modifier, in a text or behind a dialog. */
export function isCommand(event: KeyboardEvent): boolean {
  return !event.ctrlKey && !event.metaKey && !event.altKey && !isTyping(event.target)
    && document.querySelector('dialog[open]') === null;
}

/** A watch on focus, visibility, dialogs and the connection. */
export class Focus {
  #store;
  #changed;
  #gone = false;
  #focused = document.hasFocus();
  /**
   * Null while the controls may act, else why they may not: 'connection', 'hidden', 'focus' or
   * 'dialog'.
   */
  reason;

  /** `store`: its `connected` counts; `changed` called at once at each change of `reason`. */
  constructor(store: Store, changed: (reason: string | null) => void) {
    this.#store = store;
    this.#changed = changed;
    this.reason = this.#why();
    this.#listen();
  }

  #listen() {
    const focused = (value: boolean) => () => {
      this.#focused = value;
      this.#update();
    };
    const gone = (value: boolean) => () => {
      this.#gone = value;
      this.#update();
    };
    // During a blur event hasFocus() may still be true, so the events themselves count.
    window.addEventListener('blur', focused(false));
    window.addEventListener('focus', focused(true));
    window.addEventListener('pagehide', gone(true));
    window.addEventListener('pageshow', gone(false));
    document.addEventListener('freeze', gone(true));
    document.addEventListener('resume', gone(false));
    document.addEventListener('visibilitychange', () => this.#update());
    // A page that was opened in the background may get no focus event with its first click.
    window.addEventListener('pointerdown', () => focused(document.hasFocus())(), true);
    this.#store.on('connection', () => this.#update());
    new MutationObserver(() => this.#update()).observe(
      document.documentElement, { subtree: true, attributes: true, attributeFilter: ['open'] });
  }

  #why() {
    if (!this.#store.connected) {
      return 'connection';
    }
    if (this.#gone || document.visibilityState !== 'visible') {
      return 'hidden';
    }
    if (!this.#focused) {
      return 'focus';
    }
    return document.querySelector('dialog[open]') ? 'dialog' : null;
  }

  #update() {
    const reason = this.#why();
    if (reason !== this.reason) {
      this.reason = reason;
      this.#changed(reason);
    }
  }
}
