// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Where a part of this page is on the screen, for instruments that measure on the screen. */

import type { ViewPlace } from '../page_messages.js';

/** Return whether the browser's window fills the screen, also around a frame. */
export function fillsScreen(): boolean {
  return window.matchMedia('(display-mode: fullscreen)').matches
    || (window.outerWidth >= window.screen.width && window.outerHeight >= window.screen.height);
}

/**
 * The page's place on the screen. A browser tells it with the events of a mouse alone; before the
 * first, the frame of the window is taken as even at the left, at the right and below.
 */
export class ScreenPlace {
  // Of the page's upper left corner, from that of the window [CSS px].
  #inWindow: { x: number; y: number } | null = null;

  constructor() {
    window.addEventListener('pointermove', (event) => {
      this.#inWindow = { x: event.screenX - event.clientX - window.screenX,
        y: event.screenY - event.clientY - window.screenY };
    }, { passive: true });
    window.addEventListener('resize', () => { this.#inWindow = null; });
  }

  of(node: HTMLElement): ViewPlace {
    const { left, top, width, height } = node.getBoundingClientRect();
    const border = Math.max((window.outerWidth - window.innerWidth) / 2, 0);
    const corner = this.#inWindow ?? { x: border,
      y: Math.max(window.outerHeight - window.innerHeight - border, 0) };
    const whole = fillsScreen();
    const tenth = (value: number) => Math.round(10 * value) / 10;
    return [tenth(left + corner.x + (whole ? 0 : window.screenX)),
      tenth(top + corner.y + (whole ? 0 : window.screenY)), tenth(width), tenth(height),
      window.screen.width, window.screen.height,
      Math.round(1000 * window.devicePixelRatio) / 1000];
  }
}
