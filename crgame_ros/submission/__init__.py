# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Submissions to CommonRoad's benchmark: solutions out of runs, judged and packed."""
