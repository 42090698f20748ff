// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The link between a stage and the page that frames it: one origin, set by the server. */

import type { StageOrder, StageState } from './stage_messages.js';
import type { Store } from '../store.js';

/** The sender and receiver of messages to the framing page. */
export class FrameLink {
  #store;
  #told = '';

  /**
   * @param store whose `framedBy` is the origin
   * @param ordered called for each order of that page
   */
  constructor(store: Store, ordered: (order: StageOrder) => void) {
    this.#store = store;
    window.addEventListener('message', ({ source, origin, data }) => {
      if (source === window.parent && window.parent !== window && origin !== ''
          && origin === store.framedBy && isOrder(data)) {
        ordered(data);
      }
    });
  }

  /** Send the state if it has changed. */
  send(state: StageState) {
    const { framedBy } = this.#store;
    const text = JSON.stringify(state);
    if (window.parent !== window && framedBy !== '' && text !== this.#told) {
      this.#told = text;
      window.parent.postMessage({ crgame: 1, kind: 'stage', state }, framedBy);
    }
  }
}

function isOrder(data: unknown): data is StageOrder {
  if (typeof data !== 'object' || data === null) {
    return false;
  }
  const { crgame, kind, ready, profiles } = data as Record<string, unknown>;
  return crgame === 1 && (kind === 'focus' || (kind === 'ready' && typeof ready === 'boolean')
    || (kind === 'calibrations' && typeof profiles === 'object' && profiles !== null));
}
