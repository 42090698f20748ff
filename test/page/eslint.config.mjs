// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Rules of eslint for the page and its tests; tsc checks types (tsconfig.json). */

import js from '@eslint/js';
import { transformSync } from 'amaro';
import * as espree from 'espree';
import globals from 'globals';

export default [
  js.configs.recommended,
  {
    linterOptions: { reportUnusedDisableDirectives: 'error' },
    rules: {
      'array-callback-return': 'error',
      curly: 'error',
      'default-case-last': 'error',
      eqeqeq: 'error',
      'max-lines': ['error', 400],
      'no-constructor-return': 'error',
      'no-eval': 'error',
      'no-implied-eval': 'error',
      'no-promise-executor-return': 'error',
      'no-self-compare': 'error',
      'no-shadow': 'error',
      'no-unmodified-loop-condition': 'error',
      'no-unused-expressions': 'error',
      'no-unused-vars': ['error', { argsIgnorePattern: '^_' }],
      'no-use-before-define': ['error', { functions: false, classes: false, variables: false }],
      'no-useless-return': 'error',
      'no-var': 'error',
      'object-shorthand': 'error',
      'prefer-const': 'error',
      'prefer-object-has-own': 'error',
      radix: 'error',
      // Input from a person or a file is only set as text.
      'no-restricted-properties': ['error',
        ...['innerHTML', 'outerHTML', 'insertAdjacentHTML', 'writeln'].map(
          (property) => ({ property, message: 'Use the functions of dom.js.' }))],
    },
  },
  {
    files: ['page/**/*.ts'],
    // Types are the matter of tsc; without them, lines and columns are the same.
    languageOptions: { globals: globals.browser, parser: {
      parse: (text, options) => (
        espree.parse(transformSync(text, { mode: 'strip-only' }).code, options)) } },
  },
  {
    files: ['test/page/**/*.mjs'],
    // The document is that of dom_support.mjs.
    languageOptions: { globals: { ...globals.nodeBuiltin, document: 'readonly' } },
  },
];
