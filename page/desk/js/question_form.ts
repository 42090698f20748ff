// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Questions that are answered together, with their drafts and errors. */

import { element, setText } from '../../cockpit/js/dom.js';
import { hasLongLabels, QuestionView } from './question_view.js';

import type {
  Answer, Condition, LikertQuestion, Question, QuestionsDocument, Told,
} from './desk_messages.js';
import type { Draft } from './draft.js';
import type { Words } from './words.js';

/** Build the form; `finish` called with the answers once all are valid. */
export function questionForm(shown: QuestionsDocument, words: Words, draft: Draft,
  finish: (told: Told) => void): HTMLElement {
  const summary = element('p', { class: 'problem', role: 'alert' });
  const views = shown.questions.map((question) => {
    const view = new QuestionView(question, words, () => {
      draft.put(view.name, view.answer);
      update();
    });
    if (Object.hasOwn(draft.answers, view.name)) {
      view.answer = draft.answers[view.name];
    }
    return view;
  });
  const nodes = shown.matrix ? rowsOf(shown.questions, views) : views.map(({ node }) => node);
  let asked = views;
  const update = () => {
    asked = askedOf(shown.questions, views);
    views.forEach((view) => {
      view.node.hidden = !asked.includes(view);
    });
    // The head of a table goes with its last row.
    nodes.filter((node) => node.classList.contains('matrix')).forEach((node) => {
      node.hidden = !asked.some((view) => node.contains(view.node));
    });
  };
  update();
  const submit = (event: Event) => {
    event.preventDefault();
    const wrong = asked.filter((view) => {
      view.show(view.refusal());
      return view.refusal();
    });
    setText(summary, wrong.length > 1 ? words.of('missing_some', { count: wrong.length })
      : wrong.length === 1 ? words.of('missing_one') : '');
    if (wrong.length > 0) {
      wrong[0].focus();
      return;
    }
    finish({ answers: Object.fromEntries(asked.map((view) => [view.name, view.answer])),
      ...draft.times() });
  };
  return element('form', { class: 'questions', novalidate: true, on: { submit } },
    shown.title ? element('h2', { text: shown.title }) : null,
    shown.text ? element('p', { class: 'lead', text: shown.text }) : null,
    ...nodes, summary,
    element('div', { class: 'go-on' },
      element('button', { type: 'submit', class: 'primary', text: words.of('next') })));
}

/** Return the questions whose conditions hold, by the answers to those that are asked. */
function askedOf(questions: Question[], views: QuestionView[]): QuestionView[] {
  const answers = new Map<string, Answer>();
  return views.filter((view, i) => {
    const { when } = questions[i];
    const asked = when === null || holds(when, answers.get(when.question) ?? null);
    if (asked) {
      answers.set(view.name, view.answer);
    }
    return asked;
  });
}

/** Return whether an answer, or one of several that are chosen, meets a condition. */
export function holds({ one_of, at_least, below }: Condition, answer: Answer): boolean {
  if (answer === null || (Array.isArray(answer) && answer.length === 0)) {
    return false;
  }
  if ((at_least !== null || below !== null) && !(typeof answer === 'number'
    && (at_least === null || answer >= at_least) && (below === null || answer < below))) {
    return false;
  }
  const given = Array.isArray(answer) ? answer : [answer];
  return one_of.length === 0 || given.some((each) => one_of.some((value) => each === value
    || (typeof each === 'string' && each === String(value))));
}

/** Return the questions, successive ones with the same points together as a table. */
function rowsOf(questions: Question[], views: QuestionView[]): HTMLElement[] {
  const nodes: HTMLElement[] = [];
  let scale = '';
  questions.forEach((question, i) => {
    const own = scaleOf(question);
    if (own !== '' && own === scale) {
      nodes[nodes.length - 1].append(views[i].node);
    } else if (question.kind === 'likert' && own !== '') {
      const matrix = element('div', { class: 'matrix' }, headOf(question), views[i].node);
      matrix.style.setProperty('--points', String(question.points));
      nodes.push(matrix);
    } else {
      nodes.push(views[i].node);
    }
    scale = own;
  });
  return nodes;
}

/** @returns the same for questions that fit into one table, empty for one that fits into none */
function scaleOf(question: Question) {
  if (question.kind !== 'likert' || hasLongLabels(question.labels)) {
    return '';
  }
  const { points, left, right, labels } = question;
  return JSON.stringify([points, left, right, labels]);
}

/** The labels above the columns, which each row has in words that only screen readers get. */
function headOf({ left, right, labels }: LikertQuestion) {
  const texts = labels.length > 0 ? labels : [left, right];
  return element('div', { class: labels.length > 0 ? 'matrix-head' : 'matrix-head ends',
    'aria-hidden': 'true' }, ...texts.map((text) => element('span', { text })));
}
