# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The road as it lies in a map: network, lanes, signals, speed limits, surface, routes."""
