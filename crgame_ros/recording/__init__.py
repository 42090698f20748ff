# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""MCAP recordings: writing, reading, recovery, replay, CommonRoad and OpenSCENARIO files."""
