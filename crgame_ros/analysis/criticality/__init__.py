# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Criticality of what is near: how much time, room and braking is left to each vehicle."""
