// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A question to the experimenter, with a reason for the journal. */

import { element } from '../../cockpit/js/dom.js';

import type { Words } from './words.js';

/**
 * Show the dialog and return the reason.
 * @param yes text of the button that confirms
 * @param reasoned whether a reason is asked for
 * @returns the reason, empty where none is asked for; null for no
 */
export function askReason(words: Words, title: string, text: string, yes: string,
  reasoned = true): Promise<string | null> {
  return new Promise((resolve) => {
    const reason = element('input', { id: 'reason', type: 'text', required: true,
      autocomplete: 'off', maxlength: 2000 });
    let answer: string | null = null;
    const dialog = element('dialog', { class: 'asking', 'aria-labelledby': 'asking-title', on: {
      close: () => {
        dialog.remove();
        resolve(answer);
      } } },
    element('form', { method: 'dialog', on: { submit: (event) => {
      answer = reasoned ? reason.value.trim() : '';
      if (reasoned && !answer) {
        answer = null;
        event.preventDefault();
      }
    } } },
    element('h2', { id: 'asking-title', text: title }), element('p', { text }),
    reasoned ? element('label', { for: 'reason', text: words.of('desk_reason') }) : null,
    reasoned ? reason : null,
    element('div', { class: 'go-on' },
      element('button', { type: 'button', text: words.of('desk_cancel'),
        on: { click: () => dialog.close() } }),
      element('button', { type: 'submit', class: 'primary', text: yes }))));
    document.body.append(dialog);
    dialog.showModal();
  });
}
