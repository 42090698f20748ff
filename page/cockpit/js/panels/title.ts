// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The title of the shown run, in the header and in the browser's tab. */

import { setText } from '../dom.js';
import { isolated } from './format.js';

import type { Store } from '../store.js';

const PROGRAM = 'crgame';

/** Keep the title up to date. */
export function createTitle(root: HTMLElement, store: Store) {
  const update = () => {
    const title = isolated(store.scene?.title || PROGRAM);
    setText(root, title);
    root.title = [title, store.scene?.benchmark_id].filter(Boolean).join(' · ');
    document.title = [title, store.mode === 'replay' ? 'replay' : '', PROGRAM]
      .filter((part, i, all) => part && all.indexOf(part) === i).join(' · ');
  };
  store.on(['scene', 'hello'], update);
  update();
}
