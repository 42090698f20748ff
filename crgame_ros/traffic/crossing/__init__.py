# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who goes first where ways cross: stop lines, junctions, crosswalks."""
