# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From the rear axle to the centre and back: positions, and velocities as their derivatives."""

import math

from crgame_ros.geometry.reference_point import ahead, shifted, shifted_velocities
import numpy as np
import pytest


def test_ahead_is_along_the_heading() -> None:
    assert ahead(1.0, 2.0, 0.0, 1.5) == (2.5, 2.0)
    assert ahead(1.0, 2.0, 0.5 * math.pi, 1.5) == pytest.approx((1.0, 3.5))
    x, y = ahead(3.0, 4.0, 0.7, 1.3)
    assert ahead(x, y, 0.7, -1.3) == pytest.approx((3.0, 4.0))


def test_many_poses_each_with_its_distance() -> None:
    poses = np.array(((1.0, 2.0, 0.3), (5.0, -1.0, -2.0), (np.nan, 0.0, 0.0)))
    found = shifted(poses, np.array((1.0, 2.0, 3.0)))
    for row, pose, distance in zip(found[:2], poses[:2].tolist(), (1.0, 2.0), strict=True):
        assert row == pytest.approx((*ahead(*pose, distance), pose[2]))
    assert np.isnan(found[2, 0])
    assert shifted(poses[None], 1.0).shape == (1, 3, 3)


def test_velocities_are_derivatives_of_the_moved_poses() -> None:
    """Central differences over 2e-6 s of a motion that turns."""
    pose, rate, distance, step = np.array((1.0, 2.0, 0.4)), np.array((8.0, 3.0, 0.5)), 1.4, 1e-6
    expected = (shifted(pose + step * rate, distance)
                - shifted(pose - step * rate, distance)) / (2.0 * step)
    assert shifted_velocities(pose[2], rate, distance) == pytest.approx(expected, abs=1e-8)
