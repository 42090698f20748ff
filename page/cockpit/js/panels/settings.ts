// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The switch between the system's theme, dark and light. */

import { element } from '../dom.js';
import { icon } from './icons.js';
import { recall, remember } from './memory.js';

const THEMES = [
  ['', 'auto', "Theme: the system's"], ['dark', 'moon', 'Theme: dark'],
  ['light', 'sun', 'Theme: light'],
];

/**
 * Create the button that cycles through the themes. Parts that draw with the colours are notified
 * by `onThemeChange` of the world's palette.
 * @param root of the button
 * @returns theme: 'dark', 'light' or '' for the system's
 */
export function createSettings(
  root: HTMLElement): { theme: string; setTheme: (theme: string) => void } {
  const button = element('button', { type: 'button', id: 'theme', class: 'icon-button' });
  const settings = {
    theme: '',
    setTheme(theme: string) {
      const [name, picture, label] = THEMES.find(([known]) => known === theme) ?? THEMES[0];
      settings.theme = name;
      if (name) {
        document.documentElement.dataset.theme = name;
      } else {
        delete document.documentElement.dataset.theme;
      }
      button.replaceChildren(icon(picture));
      button.title = label;
      button.setAttribute('aria-label', label);
      remember('theme', name);
    },
  };
  button.addEventListener('click', () => {
    const at = THEMES.findIndex(([name]) => name === settings.theme);
    settings.setTheme(THEMES[(at + 1) % THEMES.length][0]);
  });
  root.prepend(button);
  addFullscreen(root);
  settings.setTheme(recall('theme'));
  return settings;
}

/** Add the full-screen button, if the browser supports it. */
function addFullscreen(root: HTMLElement) {
  if (!document.fullscreenEnabled) {
    return;
  }
  const full = element('button', { type: 'button', id: 'fullscreen', class: 'icon-button',
    title: 'Full screen', 'aria-label': 'Full screen', 'aria-pressed': 'false', on: {
      click: () => (document.fullscreenElement === null
        ? document.documentElement.requestFullscreen() : document.exitFullscreen()),
    } }, icon('full'));
  document.addEventListener('fullscreenchange', () => full.setAttribute('aria-pressed',
    String(document.fullscreenElement !== null)));
  root.append(full);
}
