# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rigid transforms, angles, footprints, and curves by their arc length."""
