// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** What this page's person may do, in words for the controls that they may not use. */

/** @import { Store } from './store.js' */

/**
 * Say why something may not be done here; the server refuses it all the same.
 *
 * @param {Store} store
 * @param {'direct'|'drive'} right that it needs
 * @param {string} deed as in 'reset the run'
 * @returns {string} empty if it may be done
 */
export function reasonAgainst(store, right, deed) {
  const { directs, drives, role } = store.rights;
  if (store.mode === 'replay' || role === '' || (right === 'direct' ? directs : drives)) {
    return '';
  }
  return `Only a ${right === 'direct' ? 'director' : 'driver'} can ${deed}; you are a ${role}.`;
}
