// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The 3D view's buttons on the stage. */

import { element } from '../dom.js';
import { press, toolButton } from '../world/toolbar.js';
import { VIEWPOINTS } from './cameras.js';

import type { Viewpoint } from './cameras.js';
import type { ViewSettings } from './view_settings.js';

const CUBE = 'M12 3l8 4.5v9L12 21l-8-4.5v-9zM12 12l8-4.5M12 12v9M12 12L4 7.5';
const SLIDERS = 'M4 7h9M17 7h3M15 5v4M4 17h3M11 17h9M9 15v4';
const VIEWS: Record<Viewpoint, { strokes: string; title: string }> = {
  driver: { strokes: 'M12 4a8 8 0 1 0 0 16a8 8 0 1 0 0-16M4.5 11c4-2 11-2 15 0M12 14v6'
    + 'M10 13l-5 3M14 13l5 3', title: "Driver's eye (C: next)" },
  chase: { strokes: 'M5 16v-4l2-5h10l2 5v4zM5 12h14M7 16v3M17 16v3', title: 'Behind (C: next)' },
  bird: { strokes: 'M12 3v10M8 9l4 4l4-4M5 20h14M8 16.5h8', title: 'From above (C: next)' },
};

/** Put the buttons on the stage; `update` shows the state. */
export function createViewButtons(stage: HTMLElement, settings: ViewSettings,
  { toggle, choose }: { toggle: () => void;
  choose: (viewpoint: Viewpoint) => void }): { update: (on: boolean,
  viewpoint: Viewpoint) => void } {
  const group = element('div', { class: 'world-group view3d-buttons' });
  const cube = toolButton(group, CUBE, '3D view or map (V)', toggle);
  const views = VIEWPOINTS.map((name) => ({ name, button: toolButton(
    group, VIEWS[name].strokes, VIEWS[name].title, () => choose(name)) }));
  let open = false;
  const sliders = toolButton(group, SLIDERS, 'Settings of the 3D view', () => {
    open = !open;
    settings.open(open);
    sliders.setAttribute('aria-expanded', String(open));
  });
  sliders.setAttribute('aria-expanded', 'false');
  const bar = stage.querySelector('.world-toolbar');
  bar?.prepend(group);
  stage.append(settings.node);
  return {
    update(on, viewpoint) {
      press(cube, on);
      for (const { name, button } of views) {
        button.hidden = !on;
        press(button, name === viewpoint);
      }
      sliders.hidden = !on;
      settings.open(on && open);
    },
  };
}
