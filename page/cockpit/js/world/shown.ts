// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A copy of the drawn state: the store refills its own arrays at the next call. */

/** @import { Shown } from '../store.js' */

/**
 * Copy the current state into the kept one.
 *
 * @param {Shown|null} kept of the frame before, refilled; null makes a new one
 * @param {Shown|null} shown of Store.displayed
 * @returns {Shown|null} {t, n, k, epoch, vehicles, objects}
 */
export function keepShown(kept, shown) {
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

/**
 * @param {Float64Array} target
 * @param {Float64Array} values
 */
function copied(target, values) {
  const result = target.length === values.length ? target : new Float64Array(values.length);
  result.set(values);
  return result;
}
