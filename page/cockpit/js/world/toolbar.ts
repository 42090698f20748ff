// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The world's buttons: zoom, fit, follow, heading up, layers. */

import { element, svg } from '../dom.js';

// Strokes in a square of 24.
const ICONS = {
  plus: 'M12 5v14M5 12h14',
  minus: 'M5 12h14',
  fit: 'M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5',
  follow: 'M12 3v4M12 17v4M3 12h4M17 12h4M12 7a5 5 0 1 0 0 10a5 5 0 1 0 0-10',
  heading: 'M12 3l6 17l-6-4l-6 4z',
  plan: 'M6 21c0-9 12-7 12-16M18 5l-3 3M18 5l2.5 3.5',
  prediction: 'M4 20L9 14M11.5 11L14 8M16 5.5L19 3M19 3l-4 .5M19 3l-.5 4',
  labels: 'M3 6h11l6 6l-6 6H3zM7 10v4M10 10v4',
};

/** The actions of keys and buttons. */
export interface WorldActions {
  zoomBy: (factor: number) => void;
  turnBy: (angle: number) => void; // [rad]
  fit: () => void;
  followNext: () => void;
  recenter: () => void;
  toggleHeading: () => void;
  togglePlans: () => void;
  togglePredictions: () => void;
  toggleLabels: () => void;
}

export interface ToolbarState {
  followed: string | null;
  headingUp: boolean;
  plans: boolean;
  predictions: boolean;
  labels: boolean;
}

/**
 * Put the buttons on the world.
 * @param root the element that holds the canvas
 * @returns update shows the state
 */
export function createToolbar(root: HTMLElement,
  actions: WorldActions): { update: (state: ToolbarState) => void } {
  const bar = element('div', { class: 'world-toolbar', role: 'toolbar', 'aria-label': 'View' });
  const group = () => {
    const node = element('div', { class: 'world-group' });
    bar.append(node);
    return node;
  };
  const view = group();
  view.classList.add('world-zoom');
  toolButton(view, ICONS.plus, 'Zoom in (+)', () => actions.zoomBy(1.4));
  toolButton(view, ICONS.minus, 'Zoom out (-)', () => actions.zoomBy(1 / 1.4));
  toolButton(view, ICONS.fit, 'Show the whole map (0)', actions.fit);
  const camera = group();
  const follow = toolButton(camera, ICONS.follow, 'Follow the next vehicle (F)',
    actions.followNext);
  const name = element('button', { type: 'button', class: 'followed',
    title: 'Centre on the followed vehicle', on: { click: () => actions.recenter() } });
  camera.append(name);
  const heading = toolButton(camera, ICONS.heading, 'Heading or north up (H)',
    actions.toggleHeading);
  const layers = group();
  const plans = toolButton(layers, ICONS.plan, 'Plans of the AVs', actions.togglePlans);
  const predictions = toolButton(layers, ICONS.prediction, 'What the planners expect of others',
    actions.togglePredictions);
  const labels = toolButton(layers, ICONS.labels, 'Ids: vehicles, all, none (L)',
    actions.toggleLabels);
  root.append(bar);
  return {
    update(state) {
      name.textContent = state.followed ?? 'free';
      press(follow, state.followed !== null);
      press(heading, state.headingUp);
      press(plans, state.plans);
      press(predictions, state.predictions);
      press(labels, state.labels);
    },
  };
}

/**
 * Make a button of the toolbar.
 * @param root group that receives it
 * @param strokes SVG path of its picture in a square of 24
 * @param title what it does
 * @param action called by a click
 */
export function toolButton(root: HTMLElement, strokes: string, title: string,
  action: () => void): HTMLButtonElement {
  const button = element('button', {
    type: 'button', title, 'aria-label': title, on: {
      click: () => {
        action();
        // The keyboard stays with the world: a focused button would take the space bar.
        button.blur();
      },
    },
  }, svg('svg', { viewBox: '0 0 24 24' }, svg('path', {
    d: strokes, fill: 'none', stroke: 'currentColor', 'stroke-width': 2,
    'stroke-linecap': 'round', 'stroke-linejoin': 'round',
  })));
  root.append(button);
  return button;
}

/** Show whether the switch of a button is on; `pressed`: whether it is on. */
export function press(button: HTMLElement, pressed: boolean) {
  button.setAttribute('aria-pressed', String(pressed));
}
