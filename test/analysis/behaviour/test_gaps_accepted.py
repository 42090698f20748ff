# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Gaps in the lane entered, by hand."""

import math

from crgame_ros.analysis.behaviour.gaps_accepted import AcceptedGap, gap_in_lane
from crgame_ros.analysis.behaviour.lane_visits import LaneStrip
from crgame_ros.geometry.curve import Curve
from crgame_ros.geometry.outline import placed_at
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]
CORNERS = np.array(((2.25, 0.9), (-2.25, 0.9), (-2.25, -0.9), (2.25, -0.9)))


def _car(x: float, y: float, yaw: float = 0.0) -> Array:
    return np.concatenate(([(x, y)], placed_at(CORNERS, x, y, yaw)))


def _gap(others: list[tuple[float, float]], speeds: list[float]) -> AcceptedGap:
    """Enter the lane around y = 3.5 at x = 100 with 20 m/s, from the right."""
    x = np.linspace(0.0, 400.0, 81)
    strip = LaneStrip(*(Curve.from_polyline(np.column_stack((x, np.full_like(x, y))))
                        for y in (3.5, 5.25, 1.75)))
    return gap_in_lane(strip, _car(100.0, 0.9), np.array([20.0, 0.5]),
                       [_car(*each) for each in others], np.array([(v, 0.0) for v in speeds]))


def test_leader_and_follower_bumper_to_bumper() -> None:
    """30 m ahead and 24 m behind, cars of 4.5 m: 25.5 and 19.5 m; by 20 and by 26 m/s."""
    found = _gap([(130.0, 3.4), (76.0, 3.8), (160.0, 3.5), (40.0, 3.5)],
                 [15.0, 26.0, 15.0, 26.0])
    assert found.leader is not None and found.follower is not None
    assert found.leader == pytest.approx((0, 25.5, 25.5 / 20.0))
    assert found.follower == pytest.approx((1, 19.5, 19.5 / 26.0))


def test_cars_outside_the_lane_do_not_count() -> None:
    """In the own lane, in the lane beyond, far away, absent; but one that overlaps by 0.5 m."""
    assert _gap([(120.0, 0.0), (120.0, 7.0), (300.0, 3.5), (math.nan, math.nan)],
                [10.0] * 4) == (None, None)
    assert _gap([(120.0, 1.0)], [10.0]).leader is None
    leader = _gap([(120.0, 1.35)], [10.0]).leader
    assert leader is not None and leader.gap == pytest.approx(15.5)


def test_beside_each_other_and_standing() -> None:
    """Beside each other the gap is negative; a standing car behind never arrives."""
    found = _gap([(103.0, 3.5), (80.0, 3.5)], [20.0, 0.0])
    assert found.leader is not None and found.follower is not None
    assert found.leader.gap == pytest.approx(-1.5) and found.leader.time_gap_s < 0.0
    assert math.isinf(found.follower.time_gap_s)
