// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The Plotly library, which the server has: loaded when a plot is first wanted. */

/**
 * What is used of it; traces and layouts are described at plotly.com/javascript/reference.
 *
 * @typedef {{react: (node: HTMLElement, traces: object[], layout: object, config: object) =>
 *   unknown}} Plotly
 */

const ADDRESS = '/plotly.js';

/** @type {Promise<Plotly>|null} */
let loading = null;

/**
 * Load the library once; after a failure the next call tries again.
 *
 * @returns {Promise<Plotly>}
 * @throws {Error} if it cannot be loaded
 */
export function loadPlotly() {
  loading ??= new Promise((resolve, reject) => {
    const script = document.createElement('script');
    script.src = ADDRESS;
    script.addEventListener('load', () => resolve(window.Plotly));
    script.addEventListener('error', () => {
      loading = null;
      script.remove();
      reject(new Error('The plots cannot be drawn: the server does not give the library Plotly.'));
    });
    document.head.append(script);
  });
  return loading;
}
