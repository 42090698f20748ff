# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Criticality measures: the time, space and braking left between a vehicle and those near it."""
