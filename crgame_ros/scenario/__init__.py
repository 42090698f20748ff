# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""CommonRoad files: loading, repair, spawning, prediction, and writing of their elements."""
