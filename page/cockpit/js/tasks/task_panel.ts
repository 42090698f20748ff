// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The experimenter's panel of tasks: the active ones, and a button for each. */

import { element } from '../dom.js';
import { fixed } from '../panels/format.js';
import { TriggerCards } from '../panels/trigger_cards.js';

import type { Connection } from '../connection.js';
import type { Store } from '../store.js';
import type { GameTask } from './task_messages.js';

const KINDS = { detection_response: 'Detection response', take_over: 'Take-over request',
  secondary_task: 'Secondary task' };

/** Create the panel; without tasks there is none. */
export function createTaskPanel(root: HTMLElement, store: Store, connection: Connection) {
  const cards = new TriggerCards<GameTask>(store, connection, {
    deed: 'begin or end tasks',
    items: () => store.scene?.tasks ?? [],
    about: ({ kind, seat, lead_s }) => ({ tag: KINDS[kind], more: [element('p', { class: 'dim',
      text: `For the driver of ${seat}${
        kind === 'take_over' ? `, ${fixed(lead_s ?? NaN, 1)} s ahead` : ''}` })] }),
    now: ({ name, kind }) => {
      const asks = kind === 'take_over';
      const lasts = store.tasks.running.includes(name);
      const open = store.tasks.open.find((prompt) => prompt.task === name);
      const text = asks ? 'Ask' : lasts ? 'End' : 'Begin';
      return { text, name: text, icon: 'bolt', done: asks && open !== undefined,
        state: open && asks ? (open.seen ? 'Is shown' : 'No page shows it')
          : open ? `Stimulus ${open.number}` : lasts ? 'Goes on' : '' };
    },
  });
  const box = element('section', { class: 'task-panel', hidden: true },
    element('h2', { text: 'Tasks' }), cards.list);
  root.append(box);
  const update = () => cards.update();
  const rebuild = () => {
    box.hidden = cards.rebuild() === 0;
    update();
  };
  store.on('scene', rebuild);
  store.on(['tasks', 'hello', 'you', 'connection', 'run'], update);
  rebuild();
}
