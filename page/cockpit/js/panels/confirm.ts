// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The dialog that asks before an action that cannot be undone. */

import { element, setText } from '../dom.js';

let dialog: ReturnType<typeof build> | null = null;

/** Ask, and wait for the answer; `verb` on the button that confirms. */
export function confirm(question: string, consequence: string, verb: string): Promise<boolean> {
  dialog ??= build();
  return dialog.ask(question, consequence, verb);
}

function build() {
  const title = element('h2', { id: 'confirm-title' });
  const text = element('p');
  const yes = element('button', { type: 'button', class: 'drive-button danger' });
  const no = element('button', { type: 'button', class: 'drive-button', text: 'Cancel' });
  const node = element('dialog', { class: 'confirm', 'aria-labelledby': 'confirm-title' },
    title, text, element('div', { class: 'dialog-buttons' }, no, yes));
  document.body.append(node);
  no.addEventListener('click', () => node.close('no'));
  yes.addEventListener('click', () => node.close('yes'));
  return {
    ask(question: string, consequence: string, verb: string): Promise<boolean> {
      setText(title, question);
      setText(text, consequence);
      setText(yes, verb);
      node.returnValue = 'no';
      node.showModal();
      no.focus();
      return new Promise((resolve) => {
        node.addEventListener('close', () => resolve(node.returnValue === 'yes'),
          { once: true });
      });
    },
  };
}
