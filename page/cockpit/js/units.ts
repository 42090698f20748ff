// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Factors between units that people read and those of the page. */

export const KMH = 3.6; // per m/s
export const DEGREES = 180 / Math.PI; // per radian
export const DEGREE = Math.PI / 180; // [rad]
