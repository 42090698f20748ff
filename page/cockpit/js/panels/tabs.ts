// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The panels at the right: their tabs, their width, and collapsing them. */

import { element, part } from '../dom.js';
import { PANELS } from '../parts.js';
import { icon } from './icons.js';
import { recall, remember } from './memory.js';

const NARROWEST_REM = 22;
const WIDEST_SHARE = 0.6;

/** Add the panels, which are empty and hidden; `root`: aside#panels. */
export function addPanels(root: HTMLElement) {
  root.append(...PANELS.map(({ name }) => element('section', {
    id: `panel-${name}`, class: 'panel', role: 'tabpanel', hidden: true })));
}

/** Make the tabs; `show` opens a panel by its name; `root`: aside#panels. */
export function createTabs(root: HTMLElement): { show: (name: string) => void; current: string } {
  const tabs = new Map<string, HTMLElement>();
  const list = part(root, 'tabs');
  const panels = {
    current: '',
    show(name: string) {
      panels.current = name;
      for (const [other, tab] of tabs) {
        tab.setAttribute('aria-selected', String(other === name));
        part(root, `panel-${other}`).hidden = other !== name;
      }
      remember('panel', name);
    },
  };
  // No arrow keys here, unlike in other tab lists: they steer the car.
  for (const { name, label } of PANELS) {
    const open = () => {
      collapse(root, false);
      panels.show(name);
    };
    const tab = element('button', {
      type: 'button', role: 'tab', id: `tab-${name}`, text: label,
      'aria-controls': `panel-${name}`, on: { click: open },
    });
    part(root, `panel-${name}`).setAttribute('aria-labelledby', tab.id);
    tabs.set(name, tab);
    list.append(tab);
  }
  const first = recall('panel');
  panels.show(tabs.has(first) ? first : PANELS[0].name);
  addCollapse(root);
  addHandle(root);
  releaseFocus(document);
  return panels;
}

function addCollapse(root: HTMLElement) {
  const button = element('button', {
    type: 'button', id: 'collapse', class: 'icon-button', 'aria-controls': 'panels',
    'aria-label': 'Panels', title: 'Show or hide the panels',
    on: { click: () => collapse(root, !root.hidden) },
  }, icon('panel'));
  part(document.body, 'bar-end').append(button);
  collapse(root, recall('collapsed') === 'yes');
}

function collapse(root: HTMLElement, away: boolean) {
  root.hidden = away;
  document.querySelector('#collapse')?.setAttribute('aria-expanded', String(!away));
  remember('collapsed', away ? 'yes' : 'no');
}

function addHandle(root: HTMLElement) {
  const rem = () => parseFloat(getComputedStyle(document.documentElement).fontSize);
  const setWidth = (width_rem: number) => {
    const most = WIDEST_SHARE * window.innerWidth / rem();
    const width = Math.max(NARROWEST_REM, Math.min(width_rem, most));
    document.documentElement.style.setProperty('--panel-width', `${width.toFixed(1)}rem`);
    remember('width', width.toFixed(1));
  };
  const handle = element('div', {
    id: 'panels-handle', title: 'Drag to change the width, double-click for the usual one',
    on: {
      pointerdown: (event) => {
        handle.setPointerCapture(event.pointerId);
        event.preventDefault();
      },
      pointermove: (event) => {
        if (handle.hasPointerCapture(event.pointerId)) {
          setWidth((window.innerWidth - event.clientX) / rem());
        }
      },
      dblclick: () => {
        document.documentElement.style.removeProperty('--panel-width');
        remember('width', '');
      },
    },
  });
  root.prepend(handle);
  const width_rem = parseFloat(recall('width'));
  if (width_rem > 0) {
    setWidth(width_rem);
  }
}

/**
 * Return the keys to the car after a click: the space bar brakes, and would press a focused
 * button; arrows would change a choice. Keyboard users keep the focus.
 */
function releaseFocus(scope: Document) {
  let byPointer = false;
  const blur = (target: EventTarget | null) => {
    if (target instanceof Element) {
      target.closest<HTMLElement>('button, select, input')?.blur();
    }
  };
  scope.addEventListener('pointerdown', () => { byPointer = true; }, true);
  scope.addEventListener('keydown', (event) => {
    byPointer = byPointer && event.key !== 'Tab';
  }, true);
  scope.addEventListener('click', (event) => {
    if (event.detail > 0 && event.target instanceof Element
        && event.target.closest('button, input[type=checkbox], input[type=radio]')) {
      blur(event.target);
    }
  });
  scope.addEventListener('change', (event) => {
    if (byPointer && event.target instanceof HTMLSelectElement) {
      blur(event.target);
    }
  });
}
