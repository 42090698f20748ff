// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Texts of a stage for its driver, in the language of the address. */

export type StageTrouble = 'connecting' | 'lost' | 'focus' | 'unplugged' | 'silent' | 'taken'
  | 'no_seat' | 'recording' | 'failed';
export type StageWord = StageTrouble | 'throttle' | 'brake';

export const WORDS: Record<'en' | 'de', Record<StageWord, string>> = Object.freeze({
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
  },
});
