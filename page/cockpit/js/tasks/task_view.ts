// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The light, the request and the notes of tasks, over the map and the driver's view alike. */

import { element, setText, svg } from '../dom.js';

import type { Words } from '../driver_words.js';

// A steering wheel with two hands, 24 × 24.
const WHEEL = 'M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18m0 2.2a6.8 6.8 0 0 1 6.7 5.6h-4.2a2.8 2.8 0 0 0'
  + '-5 0H5.3A6.8 6.8 0 0 1 12 5.2M5.3 13h3.9a2.8 2.8 0 0 0 1.7 1.6v4.1A6.8 6.8 0 0 1 5.3 13'
  + 'm7.8 5.7v-4.1a2.8 2.8 0 0 0 1.7-1.6h3.9a6.8 6.8 0 0 1-5.6 5.7';

/** The driver's view of tasks, without any logic. */
export class TaskView {
  light = element('div', { class: 'task-light', role: 'img', hidden: true });
  title = element('strong', { class: 'task-title' });
  label = element('span', { class: 'task-label' });
  hint = element('span', { class: 'task-hint' });
  takeButton = element('button', { type: 'button', class: 'task-take' });
  request = element('div', { class: 'task-request', role: 'alert', hidden: true },
    svg('svg', { viewBox: '0 0 24 24', class: 'task-sign', 'aria-hidden': 'true' },
      svg('path', { d: WHEEL })),
    element('div', { class: 'task-words' }, this.title, this.label, this.hint), this.takeButton);
  frame = element('div', { class: 'task-frame', 'aria-hidden': 'true', hidden: true });
  note = element('p', { class: 'task-note', role: 'status', hidden: true });
  answerButton = element('button', { type: 'button', class: 'task-answer', tabindex: '-1',
    hidden: true });
  corner = element('div', { class: 'task-corner', 'aria-hidden': 'true', hidden: true });
  // The light comes last, so that nothing hides it.
  root = element('div', { id: 'tasks' }, this.frame, this.note, this.request, this.answerButton,
    this.light, this.corner);

  /** @param stage that it covers */
  constructor(stage: HTMLElement) {
    stage.append(this.root);
  }

  /** Write the constant texts. */
  speak(words: Words, language: string) {
    this.root.lang = language;
    this.light.setAttribute('aria-label', words.light);
    setText(this.answerButton, words.answer);
    setText(this.title, words.takeOver);
    setText(this.takeButton, words.takeOver);
  }

  /**
   * Show a request, or none.
   * @param request `free`: the seat is free, so that it can be taken here
   */
  showRequest(request: { label: string; hint: string; free: boolean } | null) {
    this.request.hidden = this.frame.hidden = request === null;
    if (request !== null) {
      setText(this.label, request.label);
      this.label.hidden = request.label === '';
      setText(this.hint, request.hint);
      this.takeButton.hidden = !request.free;
    }
  }

  /** @param text of the active secondary tasks; empty for none */
  showNote(text: string) {
    setText(this.note, text);
    this.note.hidden = text === '';
  }
}
