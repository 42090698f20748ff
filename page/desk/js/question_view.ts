// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** One question on the page: its controls, its answer and its error. */

import { element, setAttribute, setText } from '../../cockpit/js/dom.js';

import type {
  Answer, ChoiceQuestion, LikertQuestion, NumberQuestion, Question, SliderQuestion, TextQuestion,
} from './desk_messages.js';
import type { Words } from './words.js';

/** The controls of one question. */
export interface Controls {
  node: HTMLElement;
  answer: () => Answer; // null where there is none
  set: (answer: Answer) => void;
  refusal: () => string; // why the answer cannot be taken, empty if it can
  inputs: HTMLElement[]; // that take the focus
}

// Labels of more characters are put below each other.
const LONG_LABEL = 24;

let numbers = 0;

/** One question with its text and its error. */
export class QuestionView {
  #controls;
  #question;
  #words;
  #problem;
  node;

  /** @param changed told when the person has changed the answer */
  constructor(question: Question, words: Words, changed: () => void) {
    numbers += 1;
    const id = `question-${numbers}`;
    this.#question = question;
    this.#words = words;
    const heard = () => {
      changed();
      if (!this.#problem.hidden) {
        this.show(this.refusal());
      }
    };
    this.#controls = controlsOf(question, words, id, heard);
    this.#problem = element('p', { class: 'problem', id: `${id}-problem`, role: 'alert',
      hidden: true });
    const { inputs, node } = this.#controls;
    const single = inputs.length === 1;
    const ask = [element('span', { class: 'ask', text: question.ask }),
      question.required ? null
        : element('span', { class: 'optional', text: ` (${words.of('optional')})` })];
    this.node = single
      ? element('div', { class: 'question', 'data-kind': question.kind,
        'data-name': question.name },
        element('label', { class: 'legend', for: inputs[0].id }, ...ask), node, this.#problem)
      : element('fieldset', { class: 'question', 'data-kind': question.kind,
        'data-name': question.name, 'aria-describedby': `${id}-problem` },
      element('legend', {}, ...ask), node, this.#problem);
    if (single) {
      setAttribute(inputs[0], 'aria-describedby', `${id}-problem`);
      setAttribute(inputs[0], 'aria-required', question.required ? 'true' : null);
    }
  }

  get name() {
    return this.#question.name;
  }

  /** @returns null where there is none */
  get answer(): Answer {
    return this.#controls.answer();
  }

  set answer(answer: Answer) {
    this.#controls.set(answer);
  }

  /** @returns why the answer cannot be taken, empty if it can */
  refusal(): string {
    const { answer } = this;
    const refusal = this.#controls.refusal();
    if (refusal) {
      return refusal;
    }
    const none = answer === null || answer === '' || (Array.isArray(answer) && !answer.length);
    return none && this.#question.required ? this.#words.of('missing') : '';
  }

  /** @param problem empty for none */
  show(problem: string) {
    this.#problem.hidden = !problem;
    setText(this.#problem, problem);
    for (const input of this.#controls.inputs) {
      setAttribute(input, 'aria-invalid', problem ? 'true' : null);
    }
  }

  focus() {
    const { inputs } = this.#controls;
    const chosen = inputs.find((input) => input instanceof HTMLInputElement && input.checked);
    (chosen ?? inputs[0]).focus();
    this.node.scrollIntoView({ block: 'nearest' });
  }
}

function controlsOf(question: Question, words: Words, id: string, changed: () => void): Controls {
  switch (question.kind) {
    case 'likert': return likert(question, id, changed);
    case 'slider': return sliderControls(question, words, id, changed);
    case 'choice': return choice(question, words, id, changed);
    case 'number': return number(question, words, id, changed);
    default: return text(question, words, id, changed);
  }
}

function likert({ points, left, right, labels }: LikertQuestion, id: string,
  changed: () => void): Controls {
  const labelled = labels.length > 0;
  const places = Array.from({ length: points }, (_, i) => option(
    'radio', id, `${i + 1}`, labels[i] ?? `${i + 1}`, changed));
  const row = element('div', { class: hasLongLabels(labels) ? 'options choices'
    : labelled ? 'options likert-labelled' : 'options likert',
  'data-points': points }, ...places.map(({ node }) => node));
  const ends = element('div', { class: 'ends' }, element('span', { text: left }),
    element('span', { text: right }));
  return {
    node: labelled || !(left || right) ? row : element('div', {}, row, ends),
    inputs: places.map(({ input }) => input),
    answer: () => {
      const place = places.findIndex(({ input }) => input.checked);
      return place < 0 ? null : place + 1;
    },
    set: (answer) => places.forEach(({ input }, i) => {
      input.checked = answer === i + 1;
    }),
    refusal: () => '',
  };
}

/** @returns whether labels need a line each */
export function hasLongLabels(labels: string[]) {
  return labels.some((label) => label.length > LONG_LABEL);
}

function choice({ several, choices }: ChoiceQuestion, words: Words, id: string,
  changed: () => void): Controls {
  const options = choices.map(([name, label]) => option(
    several ? 'checkbox' : 'radio', id, name, label, changed));
  const list = element('div', { class: 'options choices' }, ...options.map(({ node }) => node));
  const chosen = () => options.filter(({ input }) => input.checked)
    .map(({ input }) => input.value);
  return {
    node: several ? element('div', {}, element('p', { class: 'hint', text: words.of('several') }),
      list) : list,
    inputs: options.map(({ input }) => input),
    answer: () => (several ? chosen() : chosen()[0] ?? null),
    set: (answer) => options.forEach(({ input }) => {
      input.checked = Array.isArray(answer) ? answer.includes(input.value)
        : answer === input.value;
    }),
    refusal: () => '',
  };
}

function option(type: 'radio' | 'checkbox', name: string, value: string, label: string,
  changed: () => void) {
  const input = element('input', { type, name, value, on: { change: changed } });
  return { input, node: element('label', { class: 'option' }, input,
    element('span', { text: label })) };
}

/** Return the key of the words that refuse a number: they name the limits that are set. */
function refusalKey({ low, high, whole }: NumberQuestion) {
  // A limit that is not set is that far away.
  const [hasLow, hasHigh] = [low > -1e9, high < 1e9];
  if (hasLow && hasHigh) {
    return whole ? 'number_whole' : 'number_wrong';
  }
  if (!hasLow && !hasHigh) {
    return whole ? 'number_any_whole' : 'number_any';
  }
  return `number${whole ? '_whole' : ''}${hasLow ? '_low' : '_high'}`;
}

function number(question: NumberQuestion, words: Words, id: string,
  changed: () => void): Controls {
  const { low, high, whole, unit } = question;
  // A text field, so that non-numbers are reported and the mouse wheel does not change the value.
  const input = element('input', { id, type: 'text', inputmode: whole && low >= 0 ? 'numeric'
    : 'decimal', autocomplete: 'off', class: 'number', on: { input: changed } });
  const given = () => input.value.trim().replace(',', '.');
  return {
    node: element('div', { class: 'number-row' }, input,
      unit ? element('span', { class: 'unit', text: unit }) : null),
    inputs: [input],
    answer: () => (isNumber(given()) ? Number(given()) : null),
    set: (answer) => {
      input.value = answer === null ? '' : String(answer);
    },
    refusal: () => {
      if (given() === '') {
        return '';
      }
      const value = Number(given());
      const fits = isNumber(given()) && value >= low && value <= high
        && (!whole || Number.isInteger(value));
      return fits ? '' : words.of(refusalKey(question), { low, high });
    },
  };
}

function isNumber(given: string) {
  return /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i.test(given) && Number.isFinite(Number(given));
}

function text({ longest }: TextQuestion, words: Words, id: string, changed: () => void): Controls {
  const input = longest > 100 ? element('textarea', { id, rows: 4, on: { input: changed } })
    : element('input', { id, type: 'text', autocomplete: 'off', on: { input: changed } });
  return {
    node: input,
    inputs: [input],
    answer: () => input.value || null,
    set: (answer) => {
      input.value = typeof answer === 'string' ? answer : '';
    },
    refusal: () => {
      // Count as the server does: an emoji is one character.
      const count = [...input.value].length;
      return count <= longest ? '' : words.of('text_long', { longest, count });
    },
  };
}

/** Build the controls of a slider question; `id` of its input. */
function sliderControls({ low, high, step, bare, left, right }: SliderQuestion,
  words: Words, id: string, changed: () => void): Controls {
  const input = element('input', { id, type: 'range', min: low, max: high, step,
    class: bare ? 'slider bare' : 'slider' });
  let marked = false;
  const show = () => {
    setAttribute(input, 'data-unset', !marked);
    setAttribute(input, 'aria-valuetext', marked ? null : words.of('slider_unset'));
  };
  const mark = () => {
    marked = true;
    show();
    changed();
  };
  input.addEventListener('input', mark);
  // A click in the exact middle does not change the value but is an answer, as are these keys.
  // A finger's tap there causes no click event.
  for (const kind of ['click', 'pointerup']) {
    input.addEventListener(kind, () => {
      if (!marked) {
        mark();
      }
    });
  }
  input.addEventListener('keydown', ({ key }) => {
    if (!marked && (key === 'Enter' || key === ' ')) {
      mark();
    }
  });
  input.value = String((low + high) / 2);
  show();
  const count = Math.round((high - low) / step);
  const ticks = !bare && count <= 40
    ? element('div', { class: 'ticks', 'aria-hidden': 'true' },
      ...Array.from({ length: count + 1 }, () => element('i'))) : null;
  return {
    node: element('div', { class: 'slider-row' }, input, ticks,
      element('div', { class: 'ends' }, element('span', { text: left }),
        element('span', { text: right }))),
    inputs: [input],
    answer: () => (marked ? Number(input.value) : null),
    set: (answer) => {
      marked = typeof answer === 'number';
      input.value = String(marked ? answer : (low + high) / 2);
      show();
    },
    refusal: () => '',
  };
}
