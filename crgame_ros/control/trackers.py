# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The trackers that a game may name."""

from crgame_ros.control.tracker import Tracker
from crgame_ros.registry import ModelRegistry

TRACKERS = ModelRegistry(
    'trackers', 'tracker',
    {'lqr': 'crgame_ros.control.lqr:LqrTracker',
     'pure-pursuit': 'crgame_ros.control.pure_pursuit:PurePursuitTracker'},
    Tracker, 'docs/control.md')
