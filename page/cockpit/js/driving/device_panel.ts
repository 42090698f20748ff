// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The list of input devices in the Drive panel: which one drives, and its calibration. */

import { element } from '../dom.js';

import type { Gamepads } from './gamepad.js';

/** A section of the panel; `node` goes into the page. */
export class DevicePanel {
  #gamepads;
  #calibrate;
  #list = element('ul', { class: 'devices' });
  node;

  /** @param calibrate opens the dialog for a device */
  constructor(gamepads: Gamepads, calibrate: (index: number) => void) {
    this.#gamepads = gamepads;
    this.#calibrate = calibrate;
    this.node = element('section', { class: 'drive-section', 'aria-labelledby': 'devices-title' },
      element('h2', { id: 'devices-title', text: 'Input devices' }), this.#list,
      element('p', { class: 'drive-note', text: 'A gamepad or wheel appears here after you press '
        + 'one of its buttons. It drives once you move it; keys take precedence while held.' }));
    this.list();
  }

  /** List the devices that are connected now. */
  list() {
    const { active, devices } = this.#gamepads;
    this.#list.replaceChildren(
      this.#row('Keyboard', 'W A S D or arrows, space brakes, R reverse; comma and period '
        + 'indicate, J hazard lights, G horn, Backspace back on the lane after a contact',
      active === null, () => this.#gamepads.choose(null)),
      ...devices.map((device) => this.#row(shortName(device.id),
        device.calibrated ? 'calibrated' : 'default mapping, not calibrated', device === active,
        () => this.#gamepads.choose(device.index), device.index)));
  }

  #row(name: string, note: string, active: boolean, choose: () => void,
    index: number | null = null) {
    return element('li', { class: 'device', 'data-active': active },
      element('button', { type: 'button', class: 'device-choose', 'aria-pressed': String(active),
        title: `Drive with ${name}`, on: { click: choose } },
      element('span', { class: 'device-name', text: name }),
      element('span', { class: 'drive-note', text: note })),
      index === null ? null : element('button', { type: 'button', class: 'drive-button',
        text: 'Calibrate…', on: { click: () => this.#calibrate(index) } }));
  }
}

/**
 * Shorten the name of a gamepad in browsers.
 * @param id such as 'Wheel (Vendor: 046d Product: c24f)'
 */
export function shortName(id: string): string {
  return id.replace(/\s*\([^)]*Vendor:[^)]*\)/i, '').replace(/^[0-9a-f]{4}-[0-9a-f]{4}-/i, '')
    .trim() || 'Gamepad';
}
