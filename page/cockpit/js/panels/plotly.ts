// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Loader of the Plotly library from the server, at the first plot. */

/** The functions in use; traces and layouts are described at plotly.com/javascript/reference. */
export interface Plotly {
  react: (node: HTMLElement, traces: object[], layout: object, config: object) => unknown;
  toImage: (node: HTMLElement, options: object) => Promise<string>;
}

const ADDRESS = '/plotly.js';
// An element with this id makes Plotly believe that the styles of its maps, which are not used,
// exist. It would add them inline, which the page does not allow.
const MAP_STYLES = '9f215cf04c5486422605d13261cb87401f4e7763b6296af81e98efbc0130da53';

let loading: Promise<Plotly> | null = null;

/**
 * Load the library once; after a failure the next call tries again.
 * @throws {Error} if it cannot be loaded
 */
export function loadPlotly(): Promise<Plotly> {
  loading ??= new Promise((resolve, reject) => {
    const script = document.createElement('script');
    script.src = ADDRESS;
    script.addEventListener('load', () => resolve(window.Plotly));
    script.addEventListener('error', () => {
      loading = null;
      script.remove();
      reject(new Error('The plots need Plotly, which the server does not have: '
        + '`crgame page-libraries` fetches it.'));
    });
    const styles = document.createElement('meta');
    styles.id = MAP_STYLES;
    document.head.append(styles, script);
  });
  return loading;
}
