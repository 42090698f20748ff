// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The link between a stage and the page that frames it, of an origin set by the server. */

import type { StageOrder, StageState } from './stage_messages.js';
import type { Store } from '../store.js';

/** The sender and receiver of messages to the framing page. */
export class FrameLink {
  #store;
  #told = '';
  #heard = '';

  /** `store` whose `framedBy` has the origins; `ordered` called for each order of that page. */
  constructor(store: Store, ordered: (order: StageOrder) => void) {
    this.#store = store;
    window.addEventListener('message', ({ source, origin, data }) => {
      if (source === window.parent && window.parent !== window && origin !== ''
          && store.framedBy.includes(origin) && isOrder(data)) {
        this.#heard = origin;
        ordered(data);
      }
    });
  }

  /** Send the state if it has changed. */
  send(state: StageState) {
    const { framedBy } = this.#store;
    const text = JSON.stringify(state);
    if (window.parent !== window && framedBy.length > 0 && text !== this.#told) {
      this.#told = text;
      // The browser gives it only to a page of the named origin.
      for (const origin of this.#heard === '' ? framedBy : [this.#heard]) {
        window.parent.postMessage({ crgame: 1, kind: 'stage', state }, origin);
      }
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
