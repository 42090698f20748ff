// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The map's colours of people, AVs and all others, for bodies seen from outside. */

import { themeColor } from '../world/palette.js';

import type { Three } from './three.js';

const NAMES: Record<string, string | undefined> = {
  human: 'human', autonomous: 'av', traffic: 'traffic', scripted: 'scripted', static: 'static',
};

/**
 * Return a function that returns the colour of a role.
 *
 * @returns of vehicles and objects of the scene
 */
export function roleColor(three: Three): (role: string, type: string) => number {
  const known = new Map<string, number>();
  return (role, type) => {
    const name = type === 'pedestrian' || type === 'bicycle' ? 'vulnerable'
      : NAMES[role] ?? 'recorded';
    const color = known.get(name) ?? new three.Color(themeColor(name)).getHex();
    known.set(name, color);
    return color;
  };
}
