# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Curves against shapely's polylines and the closed forms of straight lines and circles."""

from collections.abc import Callable
import math

from crgame_ros.geometry.curve import Curve, nearest
from crgame_ros.geometry.polyline import ReferencePath
from crgame_ros.geometry.reference_point import beside, seen_from
import numpy as np
from numpy.typing import NDArray
import pytest
from scipy.spatial import cKDTree
import shapely
import shapely.affinity

Array = NDArray[np.float64]
RADIUS = 30.0


def arc(turns: float = 0.5, points: int = 200) -> Array:
    """Return points of a circle around (0, RADIUS), counter-clockwise from the origin."""
    angle = np.linspace(0.0, 2.0 * math.pi * turns, points)
    return RADIUS * np.column_stack((np.sin(angle), 1.0 - np.cos(angle)))


def zigzag() -> Array:
    """Return an open polyline of uneven segments, with one vertex twice."""
    random = np.random.default_rng(3)
    x = np.cumsum(random.uniform(1.0, 9.0, 12))
    points = np.column_stack((x, random.uniform(-2.0, 2.0, 12)))
    return np.insert(points, 5, points[5], axis=0)


def test_positions_are_those_of_the_polyline() -> None:
    curve, line = Curve.from_polyline(zigzag()), shapely.LineString(zigzag())
    assert curve.length == pytest.approx(line.length, abs=1e-9)
    assert len(curve.points) == 12
    s = np.linspace(0.0, curve.length, 101)
    wanted = shapely.get_coordinates(shapely.line_interpolate_point(line, s))
    assert curve.pose_at(s)[:, :2] == pytest.approx(wanted, abs=1e-9)


def test_poses_have_any_shape() -> None:
    curve = Curve.from_polyline(arc())
    s = np.linspace(-5.0, curve.length + 5.0, 12)
    flat = curve.pose_at(s)
    assert np.array_equal(curve.pose_at(s.reshape(3, 4)), flat.reshape(3, 4, 4))
    assert np.array_equal(curve.pose_at(s[7]), flat[7])


def test_a_circle_has_its_heading_and_its_curvature() -> None:
    curve = Curve.from_polyline(arc())
    pose = curve.pose_at(np.linspace(5.0, curve.length - 5.0, 50))
    angle = np.arctan2(pose[:, 0], RADIUS - pose[:, 1])
    assert pose[:, 2] == pytest.approx(angle, abs=1e-4)
    assert pose[:, 3] == pytest.approx(1.0 / RADIUS, rel=1e-4)


def test_it_is_straight_beyond_its_ends() -> None:
    curve = Curve.from_polyline(arc())
    before, behind = curve.pose_at(np.array([-7.0, curve.length + 4.0]))
    for pose, end, s in ((before, 0, -7.0), (behind, -1, 4.0)):
        heading = float(curve.heading[end])
        wanted = curve.points[end] + s * np.array((math.cos(heading), math.sin(heading)))
        assert pose == pytest.approx((*wanted, heading, 0.0), abs=1e-9)


def test_headings_do_not_jump_over_a_whole_turn() -> None:
    curve = Curve.from_polyline(arc(2.5, 1000))
    assert curve.heading[-1] - curve.heading[0] == pytest.approx(5.0 * math.pi, abs=0.02)
    assert np.array_equal(curve.heading_at(curve.s), curve.heading)


@pytest.mark.parametrize('d', [-4.0, 0.0, 5.0])
def test_projection_is_the_inverse_of_poses(d: float) -> None:
    curve = Curve.from_polyline(arc())
    s = np.linspace(-8.0, curve.length + 8.0, 60)
    points = curve.poses(s, np.full_like(s, d))[:, :2]
    found_s, found_d = curve.project(points)
    assert found_s == pytest.approx(s, abs=1e-8)
    assert found_d == pytest.approx(d, abs=1e-8)
    # On a circle the offset is the radius less the distance from its middle.
    inside = (s > 0.0) & (s < curve.length)
    distance = np.hypot(points[inside, 0], points[inside, 1] - RADIUS)
    assert found_d[inside] == pytest.approx(RADIUS - distance, abs=0.005)


def test_projection_finds_the_nearest_place_that_shapely_finds() -> None:
    curve, line = Curve.from_polyline(arc()), shapely.LineString(arc())
    random = np.random.default_rng(1)
    points = random.uniform((-5.0, -5.0), (25.0, 65.0), (200, 2))
    # Near the middle of a circle all points are equally far.
    points = points[np.hypot(points[:, 0], points[:, 1] - RADIUS) > 10.0]
    s, d = curve.project(points)
    inside = (s > 0.0) & (s < curve.length)
    assert inside.sum() > 100
    wanted = shapely.line_locate_point(line, shapely.points(points[inside]))
    assert s[inside] == pytest.approx(wanted, abs=0.3)
    away = shapely.distance(line, shapely.points(points[inside]))
    assert np.abs(d[inside]) == pytest.approx(away, abs=0.01)


@pytest.mark.parametrize('d', [-8.0, 0.5, 12.0])
def test_refining_a_rough_guess_is_exact_on_a_circle(d: float) -> None:
    """Points at an offset d get the arc length that they were made from."""
    curve = Curve.from_polyline(arc(points=2000))
    s = np.linspace(3.0, curve.length - 3.0, 40)
    points = curve.poses(s, np.full_like(s, d))[:, :2]
    guess = s + np.where(np.arange(len(s)) % 2, 2.0, -2.0)
    rough, _ = curve.refine(points, guess, 0)
    found_s, found_d = curve.refine(points, guess, 19, 1e-11)
    assert found_s == pytest.approx(s, abs=1e-9) and found_d == pytest.approx(d, abs=1e-9)
    # Newton's method: two rounds take two metres to less than a millimetre.
    assert curve.refine(points, guess, 2)[0] == pytest.approx(s, abs=1e-3)
    assert np.abs(rough - s).max() > 0.01


def test_refining_goes_straight_on_beyond_the_ends() -> None:
    curve = Curve.from_polyline(np.array([[0.0, 0.0], [10.0, 0.0]]))
    points = np.array([[-6.0, 1.0], [17.0, -2.0], [np.nan, 0.0]])
    s, d = curve.refine(points, np.array([1.0, 9.0, 5.0]))
    assert s[:2] == pytest.approx((-6.0, 17.0)) and d[:2] == pytest.approx((1.0, -2.0))
    assert np.isnan((s[2], d[2])).all()


def test_the_nearest_sample_is_that_of_a_tree() -> None:
    random = np.random.default_rng(4)
    points, samples = random.uniform(-9.0, 9.0, (70, 2)), random.uniform(-9.0, 9.0, (30, 2))
    assert np.array_equal(nearest(points, samples), cKDTree(samples).query(points)[1])


def test_many_points_are_projected_as_few(monkeypatch: pytest.MonkeyPatch) -> None:
    curve = Curve.from_polyline(arc())
    points = np.random.default_rng(2).uniform(-10.0, 40.0, (50, 2))
    whole = curve.project(points)
    monkeypatch.setattr('crgame_ros.geometry.curve._CHUNK', 7 * len(curve.steps))
    assert np.array_equal(curve.project(points), whole)


def test_one_point_is_projected_to_the_last_bit_as_among_equal_ones() -> None:
    """Points at random, at vertices, where segments tie, beyond the ends, and a missing one."""
    random = np.random.default_rng(5)
    curve, missing = Curve.from_polyline(zigzag()), [[math.nan, 0.0]]
    points = np.concatenate((random.uniform((-20.0, -9.0), (80.0, 9.0), (200, 2)), curve.points,
                             missing))
    for point in points:
        s, d = curve.project(np.tile(point, (2, 1)))
        np.testing.assert_array_equal(np.array(curve.project_one(*point.tolist())),
                                      (s[0], d[0]))


@pytest.mark.parametrize(('rounds', 'exact'), [(3, 0.0), (1, 0.0), (19, 1e-11)])
@pytest.mark.parametrize('make', [Curve.from_polyline, ReferencePath.from_polyline])
def test_few_points_are_refined_to_the_last_bit_as_many(
        make: Callable[[Array], Curve], rounds: int, exact: float) -> None:
    """The many points repeat the few: on the line, far off it, beyond it, and NaN."""
    random = np.random.default_rng(11)
    for _ in range(100):
        line = make(np.cumsum(random.normal((1.0, 0.0), 1.0, (20, 2)), axis=0))
        points = line.points[random.integers(0, len(line.points), 4)] \
            + random.normal(0.0, random.choice((0.0, 0.1, 20.0)), (4, 2))
        guess = random.uniform(-9.0, line.length + 9.0, 4)
        guess[0], guess[1] = line.s[random.integers(0, len(line.s))], line.length
        points[3, 0] = math.nan if random.random() < 0.1 else points[3, 0]
        few = line.refine(points, guess, rounds, exact)
        many = line.refine(np.tile(points, (10, 1)), np.tile(guess, 10), rounds, exact)
        for one, other in zip(few, many, strict=True):
            np.testing.assert_array_equal(one, other[:4])


def test_the_frame_of_a_pose_is_turned_and_moved() -> None:
    """Shapely turns and moves a point into the frame as well."""
    poses = np.array([[3.0, -2.0, 0.7], [3.0, -2.0, 2.9]])
    points = np.array([[8.0, 1.0], [-4.0, 6.0]])
    for pose, point, *found in zip(poses, points, *seen_from(poses, points), strict=True):
        moved = shapely.affinity.rotate(shapely.affinity.translate(
            shapely.Point(point), -pose[0], -pose[1]), -pose[2], (0.0, 0.0), use_radians=True)
        assert found == pytest.approx((moved.x, moved.y), abs=1e-12)
    ahead, left = seen_from(poses, beside(poses, np.array([1.5, -2.5]))[:, :2])
    assert ahead == pytest.approx(0.0, abs=1e-12) and left == pytest.approx((1.5, -2.5))
