// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The messages between the participant's page and the desk's server. */

export type Answer = number | string | string[] | null;

/** A condition on the answer to an earlier question; what is null or empty is not tested. */
export interface Condition {
  question: string;
  one_of: (number | string)[];
  at_least: number | null;
  below: number | null;
}

export interface Asked { name: string; ask: string; required: boolean; when: Condition | null }

export interface LikertQuestion extends Asked {
  kind: 'likert';
  points: number;
  left: string;
  right: string;
  labels: string[];
}

export interface SliderQuestion extends Asked {
  kind: 'slider';
  low: number;
  high: number;
  step: number;
  bare: boolean; // a line without ticks, and a thin mark
  left: string;
  right: string;
}

export interface ChoiceQuestion extends Asked {
  kind: 'choice';
  several: boolean;
  choices: [name: string, text: string][];
}

export interface NumberQuestion extends Asked {
  kind: 'number';
  low: number;
  high: number;
  whole: boolean;
  unit: string;
}

export interface TextQuestion extends Asked { kind: 'text'; longest: number }
export type Question = LikertQuestion | SliderQuestion | ChoiceQuestion | NumberQuestion
  | TextQuestion;
/** An element of a Markdown page. */
export type PageNode = string
  | { tag: string; children?: PageNode[]; href?: string; src?: string; alt?: string };
export interface Progress { done: number; of: number; drives_done: number; drives: number }

/** `again` is the number of repeats of the item. */
export interface Always {
  type: 'desk';
  study: string;
  participant: string;
  language: string;
  languages: string[];
  item: string;
  again: number;
  progress?: Progress;
}

export interface PlainDocument extends Always { show: 'language' | 'elsewhere' }
export interface WaitDocument extends Always {
  show: 'wait';
  why: 'held' | 'preparing' | 'failed' | 'slow';
  link?: { median_ms: number; worst_ms: number; bound_ms: number }; // if it is slow
}
export interface OverDocument extends Always {
  show: 'over';
  how: 'done' | 'declined' | 'excluded' | 'ended';
  tree: PageNode[]; // the study's own page about it, empty without one
  code: string; // for the platform that sent the participant, and where to take it; or empty
  address: string;
}

export interface QuestionsDocument extends Always {
  show: 'questions';
  title: string;
  text: string;
  matrix: boolean; // whether successive questions with the same points are one table
  questions: Question[];
}

export interface PageDocument extends Always { show: 'page'; consent: boolean; tree: PageNode[] }
export interface BreakDocument extends Always { show: 'break'; text: string; left_s: number }
export interface DeviceDocument extends Always { show: 'device'; text: string }

export interface DriveDocument extends Always {
  show: 'drive';
  phase: 'ready' | 'countdown' | 'driving' | 'ended';
  link: string;
  attempt: number;
  awaits_others: boolean; // this participant is ready, those who drive too are not
  practice: boolean;
  number: number;
}

export type DeskDocument = PlainDocument | WaitDocument | OverDocument | QuestionsDocument
  | PageDocument | BreakDocument | DeviceDocument | DriveDocument;
export type WordTable = Record<string, string>; // the page's own words, by their key
export interface WordsMessage { type: 'words'; language: string; words: WordTable }
export interface RefusedMessage { type: 'refused'; item: string; text: string }
/** `at` is the server's clock [s]. */
export interface PongMessage { type: 'pong'; t: number; at: number }

/** Times of the server's clock [s]. */
export interface Told {
  answers?: Record<string, Answer>;
  agreed?: boolean;
  device?: string;
  moved?: string[];
  shown_at: number;
  answered_at: number;
  taken_s: number;
  after_s?: Record<string, number>;
}
