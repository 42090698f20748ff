# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Environments for reinforcement learning: Gymnasium's and PettingZoo's interfaces to any game."""

from crgame_ros.paths import extra_install

try:
    import gymnasium  # noqa: F401
except ImportError as _error:
    raise ImportError('crgame_ros.gym needs the package gymnasium, which is not installed: '
                      f'{extra_install("gym")}', name='gymnasium') from _error

from crgame_ros.gym.shipped_environments import register_all  # noqa: I100 - needs gymnasium

register_all()
