# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Real-time, human-in-the-loop driving simulation on CommonRoad and ROS 2."""

__version__ = '0.1.0'
