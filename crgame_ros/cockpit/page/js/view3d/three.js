// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/**
 * The library three.js, which the server has once `crgame page-libraries` has fetched it.
 *
 * Nothing but view3d.js loads this file, when the 3D view is first wanted; everything else gets
 * the library as an argument, so that it can be loaded, and tested, without it.
 */

export * from '/three/three.module.js';
