# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Trained policies: their observations and actions, and runs as a planner or as a driver."""
