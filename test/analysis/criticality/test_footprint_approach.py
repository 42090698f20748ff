# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Footprints that approach each other, against a search by shapely in small steps."""

from crgame_ros.analysis.criticality.nearby_footprints import approach, distance, time_to_contact
import numpy as np
from numpy.typing import NDArray
import pytest
import shapely

Array = NDArray[np.float64]
RESOLUTION_S = 1e-3


def _placed(random: np.random.Generator, corners: int) -> Array:
    """Make a convex footprint of so many corners somewhere within 30 m."""
    if corners == 4:
        length, width = random.uniform(0.4, 18.0), random.uniform(0.4, 2.6)
        shape = 0.5 * np.array([(length, width), (-length, width), (-length, -width),
                                (length, -width)])
    else:
        angles = np.sort(random.uniform(0.0, 2.0 * np.pi, corners))
        shape = random.uniform(0.3, 3.0) * np.column_stack((np.cos(angles), np.sin(angles)))
    yaw = random.uniform(-np.pi, np.pi)
    turn = np.array(((np.cos(yaw), np.sin(yaw)), (-np.sin(yaw), np.cos(yaw))))
    return shape @ turn + random.uniform(-30.0, 30.0, 2)


def _searched(first: Array, second: Array, relative: Array) -> float:
    """Search the first time of contact by shapely: advance by distance over speed, safely."""
    own, speed = shapely.Polygon(first), float(np.hypot(*relative))
    time_s = 0.0
    while time_s < 60.0:
        gap = own.distance(shapely.Polygon(second + time_s * relative))
        if gap < 1e-9:
            return time_s
        # No pair approaches faster than this.
        time_s += max(gap / speed, 0.1 * RESOLUTION_S)
    return np.inf


def test_contact_against_a_search() -> None:
    """1,000 pairs of rectangles, triangles and heptagons: equal within 1 ms."""
    random = np.random.default_rng(3)
    hits = 0
    for case in range(1000):
        first, second = (_placed(random, int(random.choice((3, 4, 4, 7)))) for _ in range(2))
        velocity, other = random.uniform(-20.0, 20.0, (2, 2))
        if case % 2:
            # Half of them head for each other.
            aim = second.mean(axis=0) - first.mean(axis=0) + random.uniform(-3.0, 3.0, 2)
            velocity = other + aim / random.uniform(0.5, 5.0)
        found = float(time_to_contact(first, second, velocity, other))
        expected = _searched(first, second, other - velocity)
        hits += np.isfinite(expected)
        if np.isinf(expected) or np.isinf(found):
            # A corner that barely passes within the width of the search's step.
            assert np.isinf(expected) and np.isinf(found), case
        assert found == pytest.approx(expected, abs=RESOLUTION_S)
    assert hits > 400


def test_distance_against_shapely() -> None:
    """Many at once, apart and overlapping, equal to a distance of polygons."""
    random = np.random.default_rng(5)
    first = np.array([_placed(random, 4) for _ in range(500)])
    second = np.array([_placed(random, 4) for _ in range(500)])
    second[::3] += first[::3].mean(axis=1, keepdims=True) - second[::3].mean(axis=1, keepdims=True)
    expected = shapely.distance(shapely.polygons(first), shapely.polygons(second))
    assert (expected == 0.0).sum() > 100
    np.testing.assert_allclose(distance(first, second), expected, atol=1e-9)


def test_repeated_corners_change_nothing() -> None:
    """Footprints of fewer corners are filled up by repeating one."""
    random = np.random.default_rng(11)
    first, second = _placed(random, 3), _placed(random, 4)
    filled = np.concatenate((first, np.repeat(first[-1:], 5, axis=0)))
    velocity = second.mean(axis=0) - first.mean(axis=0)
    assert time_to_contact(filled, second, velocity, np.zeros(2)) == time_to_contact(
        first, second, velocity, np.zeros(2))
    assert distance(filled, second) == distance(first, second)


def test_side_by_side_never_touch() -> None:
    """At the same speed nothing changes; touching already counts as now."""
    square = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
    along = np.array([10.0, 0.0])
    beside = np.stack((square + (0.0, 2.5), square + (0.0, 1.5)))
    np.testing.assert_array_equal(time_to_contact(square, beside, along, along), [np.inf, 0.0])


def test_two_footprints_are_measured_to_the_last_bit_as_many() -> None:
    """With numbers as with arrays: touching, passing, side by side at rest to each other."""
    random = np.random.default_rng(17)
    for case in range(600):
        first, second = (_placed(random, int(random.choice((3, 4, 4, 7)))) for _ in range(2))
        if case % 3 == 0:
            # Along each other's edges, or one over the other.
            first, second = np.round(first - first[0]), np.round(second - second[0])
        velocity, other = random.uniform(-20.0, 20.0, (2, 2))
        velocity[case % 2] = other[case % 2] if case % 4 < 2 else velocity[case % 2]
        contact = time_to_contact(first, second, velocity, other)
        assert approach(first.tolist(), second.tolist(), (other - velocity).tolist()) == (
            contact, distance(first, second, contact == 0.0))
