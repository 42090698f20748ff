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

export type Language = keyof typeof WORDS;
export type Words = typeof WORDS['en'];

/**
 * Choose the language of a page.
 *
 * @param search query of the address, whose `lang` may name a language
 * @param ofGame language of the game
 */
export function languageOf(search: string, ofGame: string | undefined): Language {
  const known = Object.keys(WORDS) as Language[];
  const wanted = [new URLSearchParams(search).get('lang'), ofGame]
    .map((name) => String(name ?? '').toLowerCase().split('-')[0]);
  return wanted.map((name) => known.find((code) => code === name))
    .find((code) => code !== undefined) ?? 'en';
}

/**
 * Read the labels of tasks in a page's address, in the driver's language.
 *
 * @param search query of the address, whose `labels` may be JSON of texts by the task's name
 */
export function labelsOf(search: string): Map<string, string> {
  try {
    const given: unknown = JSON.parse(new URLSearchParams(search).get('labels') ?? '{}');
    return new Map(Object.entries(given ?? {}).filter(
      (entry): entry is [string, string] => typeof entry[1] === 'string'));
  } catch {
    return new Map();
  }
}

export function wordsIn(language: Language): Words {
  return WORDS[language];
}
