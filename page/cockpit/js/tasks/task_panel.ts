// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The experimenter's panel of tasks: the active ones, and a button for each. */

import { element, setAttribute, setText } from '../dom.js';
import { fixed, oneLine } from '../panels/format.js';
import { icon } from '../panels/icons.js';
import { reasonAgainst } from '../rights.js';

import type { Connection } from '../connection.js';
import type { Store } from '../store.js';
import type { GameTask } from './task_messages.js';

const KINDS = { detection_response: 'Detection response', take_over: 'Take-over request',
  secondary_task: 'Secondary task' };

/**
 * Create the panel; without tasks there is none.
 *
 * @param root #panel-events
 */
export function createTaskPanel(root: HTMLElement, store: Store, connection: Connection) {
  const list = element('ul', { class: 'event-list' });
  const box = element('section', { class: 'task-panel', hidden: true },
    element('h2', { text: 'Tasks' }), list);
  root.append(box);
  const cards = new Map<string, ReturnType<typeof makeCard>>();

  const update = () => {
    const can = store.mode === 'live' && store.connected && store.status?.run !== 'ended'
      && store.rights.directs;
    const reason = reasonAgainst(store, 'direct', 'begin or end tasks');
    for (const card of cards.values()) {
      card.update(store, can, reason);
    }
  };
  const rebuild = () => {
    cards.clear();
    for (const task of store.scene?.tasks ?? []) {
      cards.set(task.name, makeCard(task, () => press(task.name)));
    }
    list.replaceChildren(...[...cards.values()].map((card) => card.root));
    box.hidden = cards.size === 0;
    update();
  };
  const press = async (name: string) => {
    const reply = await connection.request({ type: 'trigger', event: name });
    cards.get(name)?.refused(reply.ok ? '' : oneLine(reply.text));
  };
  let run = '';
  store.on('scene', rebuild);
  store.on('tasks', update);
  store.on('hello', update);
  store.on('you', update);
  store.on('connection', update);
  store.on('status', (status) => {
    if (status.run !== run) {
      run = status.run;
      update();
    }
  });
  rebuild();
}

function makeCard(task: GameTask, press: () => void) {
  const label = oneLine(task.label || task.name);
  const button = element('button', { type: 'button', class: 'primary', on: { click: press } });
  const state = element('p', { class: 'event-state' });
  const error = element('p', { class: 'field-error', role: 'alert' });
  const asks = task.kind === 'take_over';
  const lead = asks ? `, ${fixed(task.lead_s ?? NaN, 1)} s ahead` : '';
  return {
    root: element('li', { class: 'card event', 'data-task': task.name },
      element('div', { class: 'event-head' },
        element('div', {}, element('h3', { text: label }),
          element('span', { class: 'tag', text: KINDS[task.kind] })), button),
      element('p', { class: 'dim', text: `For the driver of ${task.seat}${lead}` }), state, error),
    refused: (text: string) => setText(error, text),
    /** @param reason why it cannot be pressed, or empty */
    update(store: Store, can: boolean, reason: string) {
      const lasts = store.tasks.running.includes(task.name);
      const open = store.tasks.open.find((prompt) => prompt.task === task.name);
      button.disabled = !can || (asks && open !== undefined);
      setAttribute(button, 'title', reason || null);
      const text = asks ? 'Ask' : lasts ? 'End' : 'Begin';
      if (button.textContent !== text) {
        button.replaceChildren(icon('bolt'), text);
        button.setAttribute('aria-label', `${text} ${label}`);
      }
      setText(state, open && asks ? (open.seen ? 'Is shown' : 'No page shows it')
        : open ? `Stimulus ${open.number}` : lasts ? 'Goes on' : '');
    },
  };
}
