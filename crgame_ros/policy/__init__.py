# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a trained policy sees and does, and how it drives a run: as a planner or as a driver."""
