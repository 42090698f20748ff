// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Texts for drivers, of the stage and of tasks, in their language. */

export type StageTrouble = 'connecting' | 'lost' | 'focus' | 'unplugged' | 'silent' | 'taken'
  | 'no_seat' | 'recording' | 'failed';
export type Language = 'en' | 'de';
export type Words = Record<StageTrouble | 'throttle' | 'brake' | 'takeOver' | 'takeOverHint'
  | 'hold' | 'answer' | 'secondary' | 'light', string>;

export const WORDS: Record<Language, Words> = Object.freeze({
  en: {
    connecting: 'Connecting to the simulation.',
    lost: 'Connection lost: your vehicle brakes by itself.',
    focus: 'Hands off: click here to drive.',
    unplugged: 'The input device is unplugged: plug it in and move it, or press a driving key.',
    silent: 'Nothing comes from your controls: the vehicle brakes by itself.',
    taken: 'Another person drives this vehicle.',
    no_seat: 'This run has no such vehicle.',
    recording: 'This is a recording: it cannot be driven.',
    failed: 'A part of this page has failed.',
    throttle: 'Throttle', brake: 'Brake',
    takeOver: 'Take over', takeOverHint: 'Hands on the controls: {key} or this button',
    hold: 'Drive yourself now', answer: 'Answer', secondary: 'Task', light: 'Light',
  },
  de: {
    connecting: 'Verbindung zur Simulation wird hergestellt.',
    lost: 'Verbindung verloren: Ihr Fahrzeug bremst von selbst.',
    focus: 'Zum Fahren hier klicken.',
    unplugged: 'Das Eingabegerät ist nicht angeschlossen: anschließen und bewegen oder eine '
      + 'Fahrtaste drücken.',
    silent: 'Von Ihren Bedienelementen kommt nichts an: das Fahrzeug bremst von selbst.',
    taken: 'Jemand anderes fährt dieses Fahrzeug.',
    no_seat: 'Dieses Fahrzeug gibt es in dieser Fahrt nicht.',
    recording: 'Dies ist eine Aufzeichnung: hier kann niemand fahren.',
    failed: 'Ein Teil dieser Seite ist ausgefallen.',
    throttle: 'Gas', brake: 'Bremse',
    takeOver: 'Übernehmen', takeOverHint: 'Hände an die Steuerung: {key} oder diese Taste',
    hold: 'Fahren Sie jetzt selbst', answer: 'Antworten', secondary: 'Aufgabe', light: 'Licht',
  },
});

/**
 * Choose the language of a page.
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
