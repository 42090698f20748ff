// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Hooks of ts_loader.mjs: `x.js` is `x.ts` without its types, as at the server. */

import { readFile } from 'node:fs/promises';

import { transformSync } from 'amaro';

/**
 * Take the types out of TypeScript, by the implementation in Node itself.
 *
 * @param {string} source
 * @returns {string} JavaScript with the same lines and columns
 */
export function withoutTypes(source) {
  return transformSync(source, { mode: 'strip-only' }).code;
}

export async function resolve(specifier, context, next) {
  try {
    return await next(specifier, context);
  } catch (error) {
    if (error.code !== 'ERR_MODULE_NOT_FOUND' || !specifier.endsWith('.js')) {
      throw error;
    }
    return next(specifier.replace(/\.js$/, '.ts'), context);
  }
}

export async function load(url, context, next) {
  if (!url.endsWith('.ts')) {
    return next(url, context);
  }
  const source = await readFile(new URL(url), 'utf8');
  return { format: 'module', shortCircuit: true, source: withoutTypes(source) };
}
