# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Paths against circles and the curvilinear frame of CommonRoad's library."""

import math

from commonroad_clcs.pycrccosy import CurvilinearCoordinateSystem
from crgame_ros.errors import InputError
from crgame_ros.geometry.polyline import ReferencePath, resample
import numpy as np
import pytest

RADIUS = 30.0


def circle(turns: float = 1.0, points: int = 80) -> ReferencePath:
    """Make a path along a circle around (0, RADIUS), counter-clockwise from the origin."""
    angle = np.linspace(0.0, 2.0 * math.pi * turns, int(points * turns))
    return ReferencePath.from_polyline(
        RADIUS * np.column_stack((np.sin(angle), 1.0 - np.cos(angle))))


def test_circle_keeps_radius_and_curvature() -> None:
    path = circle()
    inner = slice(30, -30)
    radius = np.hypot(path.points[:, 0], path.points[:, 1] - RADIUS)
    assert radius[inner] == pytest.approx(RADIUS, abs=0.05)
    assert path.curvature[inner] == pytest.approx(1.0 / RADIUS, abs=0.001)
    turn = path.heading[-31] - path.heading[30]
    assert turn == pytest.approx((path.s[-31] - path.s[30]) / RADIUS, abs=0.01)
    # Unwrapped: the end of the circle does not fall back to the heading of its start.
    assert path.heading[-1] - path.heading[0] > 6.0


def test_sharp_corner_is_rounded_below_the_bound() -> None:
    corner = np.array([[0.0, 0.0], [50.0, 0.0], [50.0, 50.0]])
    path = ReferencePath.from_polyline(corner, max_curvature=0.2)
    assert 0.05 < np.abs(path.curvature).max() <= 0.21
    assert path.heading[-1] == pytest.approx(0.5 * math.pi, abs=1e-3)


def test_projection_inverts_the_pose() -> None:
    path = circle()
    s = np.linspace(20.0, 100.0, 33)
    for d in (-3.0, 0.0, 4.0):
        pose = path.pose_at(s)
        points = pose[:, :2] + d * np.column_stack((-np.sin(pose[:, 2]), np.cos(pose[:, 2])))
        found_s, found_d = path.project(points, 0.0, 110.0)
        assert found_s == pytest.approx(s, abs=1e-3)
        assert found_d == pytest.approx(d, abs=1e-3)


def test_projection_of_nan_is_nan() -> None:
    s, d = circle().project(np.array([[np.nan, np.nan], [5.0, 0.5]]))
    assert np.isnan([s[0], d[0]]).all() and np.isfinite([s[1], d[1]]).all()


def test_one_pose_is_located_as_many_are() -> None:
    path = circle()
    for angle, d in ((0.8, -2.0), (1.5, 0.0), (2.4, 4.0)):
        x, y = (RADIUS - d) * math.sin(angle), RADIUS - (RADIUS - d) * math.cos(angle)
        s, aside, heading = path.locate(x, y, RADIUS * angle + 2.0)
        assert (s, aside) == pytest.approx((RADIUS * angle, d), abs=0.05)
        assert heading == pytest.approx(angle, abs=0.005)
        many = path.refine(np.array([[x, y]]), np.array([RADIUS * angle + 2.0]))
        assert (s, aside) == pytest.approx((many[0][0], many[1][0]), abs=1e-4)
        assert path.curvature_at(s) == pytest.approx(1.0 / RADIUS, rel=0.02)
        assert path.curvature_at(s) == pytest.approx(path.pose_at(np.array(s))[3], abs=1e-12)


def test_a_path_ends_at_its_ends() -> None:
    path = ReferencePath.from_polyline(np.array([[0.0, 0.0], [20.0, 0.0]]))
    assert path.pose_at(np.array([-3.0, 99.0, np.nan]))[:, 0] == pytest.approx(
        (0.0, path.length, 0.0), abs=1e-4)
    # Points beyond them have arc lengths, too.
    s, d = path.project(np.array([[-4.0, 1.0], [25.0, -2.0]]))
    assert s == pytest.approx((-4.0, 25.0), abs=1e-4) and d == pytest.approx((1.0, -2.0))
    assert path.locate(25.0, -2.0, 15.0) == pytest.approx((25.0, -2.0, 0.0), abs=1e-4)


def test_window_separates_the_laps_of_a_loop() -> None:
    path = circle(2.0)
    lap = 2.0 * math.pi * RADIUS
    point = path.pose_at(np.array([0.25 * lap]))[:, :2]
    assert path.project(point, 0.0, 0.5 * lap)[0][0] == pytest.approx(0.25 * lap, abs=0.1)
    assert path.project(point, lap, 1.5 * lap)[0][0] == pytest.approx(1.25 * lap, abs=0.6)


def test_projection_is_that_of_commonroads_frame() -> None:
    """It agrees with Wuersching and Althoff (CRG 1 and its reference 9), and with a circle."""
    path = circle(0.5)
    frame = CurvilinearCoordinateSystem(path.points, 20.0, 0.1)
    # The library extends the path at both ends; its s starts before ours.
    shift = path.step - frame.convert_to_curvilinear_coords(*path.points[1], False)[0]
    for angle in (0.5, 1.2, 2.0):
        for d in (-2.0, 0.0, 3.0):
            place = (RADIUS - d) * math.sin(angle), RADIUS - (RADIUS - d) * math.cos(angle)
            (s,), (aside,) = path.project(np.array([place]))
            # Resampling a polyline of 80 chords shortens the circle by 0.03 %.
            assert (s, aside) == pytest.approx((RADIUS * angle, d), abs=0.08)
            theirs = frame.convert_to_curvilinear_coords(*place)
            assert (s - shift, aside) == pytest.approx(theirs, abs=0.01)


@pytest.mark.parametrize('points', [[[0.0, 0.0]], [[1.0, 1.0], [1.0, 1.0]],
                                    [[0.0, 0.0], [np.nan, 1.0]]])
def test_degenerate_polylines_are_refused(points: list[list[float]]) -> None:
    with pytest.raises(InputError, match='polyline'):
        resample(np.array(points), 0.5)
