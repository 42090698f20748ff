// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The words that the desk's pages are shipped with. */

import { readFileSync } from 'node:fs';

import { Words } from '../../page/desk/js/words.js';

/** Read the words in a language, from lines such as `key: text` and `key: "text"`. */
export function shippedWords(language) {
  const file = new URL(`../../crgame_ros/study/desk/words/${language}.yaml`, import.meta.url);
  const lines = readFileSync(file, 'utf8').split('\n').filter((line) => /^\w/.test(line));
  const words = new Words();
  words.load(Object.fromEntries(lines.map((line) => {
    const [, key, quoted, plain] = /^(\w+): (?:"(.*)"|(.*))$/.exec(line);
    return [key, quoted ?? plain];
  })), language);
  return words;
}
