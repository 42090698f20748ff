// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Texts of tasks for drivers, in their language. */

const WORDS = {
  en: {
    takeOver: 'Take over', takeOverHint: 'Hands on the controls: {key} or this button',
    hold: 'Drive yourself now', answer: 'Answer', secondary: 'Task', light: 'Light',
  },
  de: {
    takeOver: 'Übernehmen', takeOverHint: 'Hände an die Steuerung: {key} oder diese Taste',
    hold: 'Fahren Sie jetzt selbst', answer: 'Antworten', secondary: 'Aufgabe', light: 'Licht',
  },
};

/** @typedef {keyof typeof WORDS} Language */
/** @typedef {typeof WORDS['en']} Words */

/**
 * Choose the language of a page.
 *
 * @param {string} search query of the address, whose `lang` may name a language
 * @param {string|undefined} ofGame language of the game
 * @returns {Language}
 */
export function languageOf(search, ofGame) {
  const known = /** @type {Language[]} */ (Object.keys(WORDS));
  const wanted = [new URLSearchParams(search).get('lang'), ofGame]
    .map((name) => String(name ?? '').toLowerCase().split('-')[0]);
  return wanted.map((name) => known.find((code) => code === name))
    .find((code) => code !== undefined) ?? 'en';
}

/**
 * @param {Language} language
 * @returns {Words}
 */
export function wordsIn(language) {
  return WORDS[language];
}
