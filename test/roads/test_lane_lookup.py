# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The lanes of many poses at once."""

import math

from crgame_ros.scenario.prediction import LaneLookup
import numpy as np
import pytest


@pytest.mark.parametrize('degrees', [0.0, 17.0, 45.0, 137.0, 180.0, 251.0])
def test_of_lanes_that_lie_upon_each_other_the_first_counts(degrees: float) -> None:
    """Two lanes fork after 20 m: before that rounding must not choose between them."""
    s = np.arange(0.0, 40.0, 0.5)
    aside = np.maximum(s - 20.0, 0.0) ** 2 / 100.0
    straight = np.stack((s, np.zeros_like(s), np.zeros_like(s)), axis=-1)
    angle = math.radians(degrees)
    cos, sin = math.cos(angle), math.sin(angle)

    def turned(poses: np.ndarray) -> np.ndarray:
        x, y = poses[:, 0] + 311.7, poses[:, 1] - 82.9
        return np.stack((cos * x - sin * y, sin * x + cos * y, poses[:, 2] + angle), axis=-1)

    tables = [turned(straight + np.stack((0.0 * s, side * aside, 0.0 * s), axis=-1))
              for side in (1.0, -1.0)]
    lookup = LaneLookup(tables, 0.5)
    poses = np.array([(x, y, 0.1) for x in np.linspace(1.0, 18.0, 41) for y in (-0.7, 0.0, 0.9)])
    lanes, along, offset = lookup.find(turned(poses), np.full(len(poses), 0.2))
    assert np.all(lanes == 0)
    assert along == pytest.approx(poses[:, 0], abs=1e-9)
    assert offset == pytest.approx(poses[:, 1], abs=1e-9)
    # Of two at the same angle only the one that may cross lanes less steeply is in none.
    assert lookup.find(turned(poses[:2]), np.array([0.05, 0.2]))[0].tolist() == [-1, 0]
