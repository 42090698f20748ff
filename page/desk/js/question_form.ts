// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Questions that are answered together, with their drafts and errors. */

import { element, setText } from '../../cockpit/js/dom.js';
import { QuestionView } from './question_view.js';

import type { QuestionsDocument, Told } from './desk_messages.js';
import type { Draft } from './draft.js';
import type { Words } from './words.js';

/**
 * Build the form.
 *
 * @param finish called with the answers once all are valid
 */
export function questionForm(shown: QuestionsDocument, words: Words, draft: Draft,
  finish: (told: Told) => void): HTMLElement {
  const summary = element('p', { class: 'problem', role: 'alert' });
  const views = shown.questions.map((question) => {
    const view = new QuestionView(question, words, () => draft.put(view.name, view.answer));
    if (Object.hasOwn(draft.answers, view.name)) {
      view.answer = draft.answers[view.name];
    }
    return view;
  });
  const submit = (event: Event) => {
    event.preventDefault();
    const wrong = views.filter((view) => {
      view.show(view.refusal());
      return view.refusal();
    });
    setText(summary, wrong.length > 1 ? words.of('missing_some', { count: wrong.length })
      : wrong.length === 1 ? words.of('missing_one') : '');
    if (wrong.length > 0) {
      wrong[0].focus();
      return;
    }
    finish({ answers: Object.fromEntries(views.map((view) => [view.name, view.answer])),
      ...draft.times() });
  };
  return element('form', { class: 'questions', novalidate: true, on: { submit } },
    shown.title ? element('h2', { text: shown.title }) : null,
    shown.text ? element('p', { class: 'lead', text: shown.text }) : null,
    ...views.map(({ node }) => node), summary,
    element('div', { class: 'go-on' },
      element('button', { type: 'submit', class: 'primary', text: words.of('next') })));
}
