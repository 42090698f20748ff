# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Outlines of shapes: areas, distances and a second way to place them."""

import math

from crgame_ros.geometry.outline import half_extents, outline, placed, placed_at, placed_polygon
from crgame_ros.geometry.shape import Shape
import numpy as np
import pytest
import shapely
import shapely.affinity

TRIANGLE = ((-2.0, -1.0), (2.0, -1.0), (0.0, 3.0))
SHAPES = (Shape.rectangle(4.0, 2.0), Shape.circle(0.5), Shape.polygon(TRIANGLE))


def test_corners_are_those_of_the_shape_counter_clockwise() -> None:
    assert outline(SHAPES[0]).tolist() == [[2.0, 1.0], [-2.0, 1.0], [-2.0, -1.0], [2.0, -1.0]]
    assert outline(SHAPES[2]).tolist() == [list(corner) for corner in TRIANGLE]
    assert all(shapely.LinearRing(outline(shape)).is_ccw for shape in SHAPES)


def test_a_circle_is_enclosed_or_touched() -> None:
    """The 64 corners lie outside by less than 0.2 %, sides touch it; eight on it lie within."""
    around, within = outline(SHAPES[1]), outline(SHAPES[1], 8, encloses=False)
    assert (len(around), len(within)) == (64, 8)
    corners = np.hypot(*around.T)
    assert 0.5 < corners.min() and corners.max() < 0.5 * 1.002
    assert shapely.LinearRing(around).distance(shapely.Point(0.0, 0.0)) == pytest.approx(0.5)
    assert np.hypot(*within.T) == pytest.approx(0.5)


@pytest.mark.parametrize('shape', SHAPES)
def test_placing_turns_and_moves(shape: Shape) -> None:
    """Against shapely's own affinities, for one pose and for many."""
    poses = np.array(((0.0, 0.0, 0.0), (10.0, -5.0, 2.0), (1e6, 2e6, -math.pi)))
    corners = outline(shape)
    many = placed(corners, poses)
    assert many.shape == (3, len(corners), 2)
    for row, (x, y, yaw) in zip(many, poses.tolist(), strict=True):
        expected = shapely.affinity.translate(shapely.affinity.rotate(
            shapely.Polygon(corners), yaw, (0.0, 0.0), use_radians=True), x, y)
        for found in (row, placed_at(corners, x, y, yaw),
                      shapely.get_coordinates(placed_polygon(shape, x, y, yaw))[:-1]):
            np.testing.assert_allclose(
                found, shapely.get_coordinates(expected)[:-1], rtol=0.0, atol=1e-9)
    assert np.isnan(placed(corners, np.array((np.nan, 0.0, 0.0)))[:, 0]).all()


def test_extents_are_those_of_the_turned_corners() -> None:
    turn = np.array((0.0, 0.5 * math.pi, 0.6, -2.8))
    along, across = half_extents(np.full(4, 4.0), np.full(4, 2.0), turn)
    corners = placed(outline(SHAPES[0]), np.column_stack((np.zeros((4, 2)), turn)))
    np.testing.assert_allclose(np.stack((along, across), axis=-1), corners.max(axis=1))


def test_each_pose_may_have_corners_of_its_own() -> None:
    corners = np.stack([outline(SHAPES[0]), 2.0 * outline(SHAPES[0])])
    poses = np.array(((1.0, 0.0, 0.0), (0.0, 1.0, 0.5 * math.pi)))
    found = placed(corners, poses)
    for row, own, pose in zip(found, corners, poses, strict=True):
        assert row == pytest.approx(placed(own, pose))
