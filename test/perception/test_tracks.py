# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Memory of perceived objects, and their predicted motion."""

import math

from crgame_ros.perception.perception import Tracks
import numpy as np
import pytest

FIRST = np.array([0])


def seen(speed: float, turn_rate: float, turning: bool = True) -> Tracks:
    """Return tracks of one object that was seen at step 0 moving along x."""
    tracks = Tracks(np.array([turning]), 0.01)
    tracks.update(FIRST, 0, 1000, np.zeros((1, 3)), np.array([[speed, 0.0, turn_rate]]))
    return tracks


def test_an_older_view_does_not_replace_a_newer_one() -> None:
    """A slow sensor's report of step 20 after a fast one's of 30 only prolongs the memory."""
    tracks = Tracks(np.array([True]), 0.01)
    tracks.update(FIRST, 30, 40, np.array([[3.0, 0.0, 0.0]]), np.zeros((1, 3)))
    tracks.update(FIRST, 20, 60, np.array([[2.0, 0.0, 0.0]]), np.zeros((1, 3)))
    poses, _ = tracks.predict(FIRST, 35, np.zeros(1))
    assert poses[0, 0, 0] == 3.0
    assert [bool(tracks.known(n)[0]) for n in (35, 59, 60)] == [True, True, False]


@pytest.mark.parametrize(('speed', 'given', 'kept'), [
    (10.0, 0.3, 0.3), (10.0, 3.0, 0.4), (1.0, -3.0, -0.2), (0.0, 3.0, 0.0)])
def test_turn_rate_is_what_a_vehicle_can_do(speed: float, given: float, kept: float) -> None:
    """It is limited to 4 m/s^2 laterally and 0.2 /m of curvature; the motion is an arc."""
    poses, velocities = seen(speed, given).predict(FIRST, 0, np.array([0.0, 2.0]))
    assert velocities[0, 0, 2] == pytest.approx(kept)
    assert poses[1, 0, 2] == pytest.approx(2.0 * kept)
    if kept:
        radius = speed / kept
        assert poses[1, 0, 0] == pytest.approx(radius * math.sin(2.0 * kept))
        assert poses[1, 0, 1] == pytest.approx(radius * (1.0 - math.cos(2.0 * kept)))


def test_a_pedestrian_goes_straight() -> None:
    """A pedestrian that turns on the spot is still predicted straight on."""
    poses, velocities = seen(1.5, 2.0, turning=False).predict(FIRST, 100, np.array([1.0]))
    np.testing.assert_allclose(poses[0, 0], (3.0, 0.0, 0.0))
    np.testing.assert_allclose(velocities[0, 0], (1.5, 0.0, 0.0))
