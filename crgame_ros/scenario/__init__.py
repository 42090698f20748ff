# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The CommonRoad file: loading, mending, spawning, prediction, and its elements written."""
