// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A copy of the drawn state: the store refills its own arrays at the next call. */

import type { Shown } from '../store.js';

/**
 * Copy the current state into the kept one.
 * @param kept of the frame before, refilled; null makes a new one
 * @param shown of Store.displayed
 * @returns {t, n, k, epoch, vehicles, objects}
 */
export function keepShown(kept: Shown | null, shown: Shown | null): Shown | null {
  if (shown === null) {
    return null;
  }
  const { t, n, k, epoch } = shown;
  const target = kept ?? { vehicles: new Float64Array(0), objects: new Float64Array(0) };
  return Object.assign(target, {
    t, n, k, epoch, vehicles: copied(target.vehicles, shown.vehicles),
    objects: copied(target.objects, shown.objects),
  });
}

function copied(target: Float64Array, values: Float64Array) {
  const result = target.length === values.length ? target : new Float64Array(values.length);
  result.set(values);
  return result;
}
