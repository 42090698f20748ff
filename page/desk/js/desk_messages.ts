// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * The messages between the participant's page and the desk's server.
 *
 * @typedef {number|string|string[]|null} Answer
 *
 * @typedef {{name: string, ask: string, required: boolean}} Asked
 * @typedef {Asked & {kind: 'likert', points: number, left: string, right: string,
 *   labels: string[]}} LikertQuestion
 * @typedef {Asked & {kind: 'slider', low: number, high: number, step: number, left: string,
 *   right: string}} SliderQuestion
 * @typedef {Asked & {kind: 'choice', several: boolean,
 *   choices: [name: string, text: string][]}} ChoiceQuestion
 * @typedef {Asked & {kind: 'number', low: number, high: number, whole: boolean,
 *   unit: string}} NumberQuestion
 * @typedef {Asked & {kind: 'text', longest: number}} TextQuestion
 * @typedef {LikertQuestion|SliderQuestion|ChoiceQuestion|NumberQuestion|TextQuestion} Question
 *
 * @typedef {string|{tag: string, children?: PageNode[], href?: string, src?: string,
 *   alt?: string}} PageNode  an element of a Markdown page
 *
 * @typedef {{done: number, of: number, drives_done: number, drives: number}} Progress
 * @typedef {{type: 'desk', study: string, participant: string, language: string,
 *   languages: string[], item: string, again: number,
 *   progress?: Progress}} Always  `again` is the number of repeats of the item
 * @typedef {Always & {show: 'language'|'elsewhere'}} PlainDocument
 * @typedef {Always & {show: 'wait', why: 'held'|'preparing'|'failed'}} WaitDocument
 * @typedef {Always & {show: 'over', how: 'done'|'declined'|'ended'}} OverDocument
 * @typedef {Always & {show: 'questions', title: string, text: string, questions: Question[]}
 *   } QuestionsDocument
 * @typedef {Always & {show: 'page', consent: boolean, tree: PageNode[]}} PageDocument
 * @typedef {Always & {show: 'break', text: string, left_s: number}} BreakDocument
 * @typedef {Always & {show: 'device', text: string}} DeviceDocument
 * @typedef {Always & {show: 'drive', phase: 'ready'|'countdown'|'driving'|'ended', link: string,
 *   attempt: number, practice: boolean, number: number}} DriveDocument
 * @typedef {PlainDocument|WaitDocument|OverDocument|QuestionsDocument|PageDocument|BreakDocument
 *   |DeviceDocument|DriveDocument} DeskDocument
 *
 * @typedef {Record<string, string>} WordTable  the page's own words, by their key
 * @typedef {{type: 'words', words: WordTable}} WordsMessage
 * @typedef {{type: 'refused', item: string, text: string}} RefusedMessage
 * @typedef {{type: 'pong', t: number, at: number}} PongMessage  `at` is the server's clock [s]
 *
 * @typedef {{answers?: Record<string, Answer>, agreed?: boolean, device?: string,
 *   moved?: string[], shown_at: number, answered_at: number, taken_s: number,
 *   after_s?: Record<string, number>}} Told  times of the server's clock [s]
 */
export {};
