# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The bounds of a run's real-time factor, in simulated seconds per second."""

MIN_REAL_TIME_FACTOR = 0.1
MAX_REAL_TIME_FACTOR = 10.0
