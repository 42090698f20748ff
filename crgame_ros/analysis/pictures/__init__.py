# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Figures of runs for papers: frames of the scene, profiles, timing."""
