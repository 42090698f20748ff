// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * The library three.js, which the server has after `crgame page-libraries` has downloaded it.
 *
 * Only view3d.ts loads this file, when the 3D view is first shown. All other modules get the
 * library as an argument, so that they can be loaded and tested without it.
 */

export * from '/three/three.module.js';

export type Three = typeof import('./three.js');
