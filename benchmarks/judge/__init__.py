# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Faults of traffic, found from outside: from states and a CommonRoad file alone."""
