# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The elastic band (FS M1) against its closed form and against boxes moved along it."""

import math

from crgame_ros.errors import InputError
from crgame_ros.traffic.motion.elastic_band import _band, Band, ElasticBand
from crgame_ros.traffic.motion.passage import Obstacles
import numpy as np
from numpy.typing import NDArray
import pytest
from scipy.optimize import lsq_linear
from shapely import affinity
from shapely.geometry import box, Polygon

Array = NDArray[np.float64]
S = 301
WIDTH, LENGTH = 2.0, 5.0


def obstacles(*rows: tuple[float, float, float, float]) -> Obstacles:
    """Collect (s, d, half length, half width)."""
    return Obstacles(*np.array(rows, dtype=float).reshape(-1, 4).T)


def one_lane(planner: ElasticBand, found: Obstacles, left: float = 5.25, right: float = 1.75,
             speed: float = 14.0) -> Band:
    """Relax the band of a lane that may borrow the space of its left neighbour."""
    return planner.relax(np.full(S, left), np.full(S, right), speed, found)


def least_distance(band: Band, found: Obstacles) -> float:
    """Move a car's box along a reference; return its least distance to the boxes."""
    others = [box(s - length, d - width, s + length, d + width)
              for s, d, length, width in zip(*found, strict=True)]
    car = box(-0.5 * LENGTH, -0.5 * WIDTH, 0.5 * LENGTH, 0.5 * WIDTH)
    grid, slopes = np.arange(float(len(band.d))), np.gradient(np.pad(band.d, 1))[1:-1]
    least = math.inf
    for s in np.arange(0.0, grid[-1], 0.25):
        d, slope = np.interp(s, grid, band.d), np.interp(s, grid, slopes)
        turned: Polygon = affinity.translate(
            affinity.rotate(car, math.atan(slope), origin=(0.0, 0.0), use_radians=True), s, d)
        least = min(least, *(turned.distance(other) for other in others))
    return least


def test_one_narrow_obstacle_has_the_closed_form() -> None:
    """D (1 + x / m) exp(-x / m), with the curvature -D / m^2 at the obstacle."""
    band = ElasticBand(step=0.25, half_length=1e-3).relax(
        np.full(1201, 6.0), np.full(1201, 0.5), 10.0, obstacles((150.0, 0.0, 1e-3, 0.5)))
    offset, m = 2.0, 12.0
    x = np.abs(0.25 * np.arange(1201) - 150.0)
    expected = offset * (1.0 + x / m) * np.exp(-x / m)
    np.testing.assert_allclose(band.d, expected, atol=0.015 * offset)
    assert band.d.max() == pytest.approx(offset, abs=2e-3)
    assert band.curvature.min() == pytest.approx(-offset / m ** 2, rel=0.03)
    inflection = offset / m ** 2 * math.exp(-2.0)
    assert band.curvature.max() == pytest.approx(inflection, rel=0.03)


def test_a_lane_without_anything_in_the_way_is_exactly_straight() -> None:
    """Obstacles beside the lane, and none at all."""
    for found in (obstacles(), obstacles((100.0, -2.6, 2.5, 1.0), (100.0, 4.0, 2.5, 1.0))):
        band = one_lane(ElasticBand(), found)
        assert not band.d.any() and not band.curvature.any() and band.blocked == []


@pytest.mark.slow
@pytest.mark.parametrize('found', [
    obstacles((150.0, 0.0, 2.25, 0.9)),
    obstacles((150.0, -1.4, 2.25, 0.9)),
    obstacles((150.0, -0.8, 12.0, 0.6)),
    obstacles((120.0, -1.2, 2.0, 0.8), (150.0, -1.6, 6.0, 1.0), (190.0, -1.0, 1.0, 0.4)),
    obstacles((120.0, -1.0, 1.0, 0.8), (165.0, 4.4, 1.0, 1.2)),
    obstacles((120.0, -1.0, 1.0, 0.8), (200.0, 2.0, 1.0, 1.2)),
], ids=['middle', 'edge', 'long', 'row', 'narrows', 'slalom'])
@pytest.mark.parametrize('speed', [5.0, 14.0, 25.0])
def test_the_clearance_is_kept(found: Obstacles, speed: float) -> None:
    """Boxes moved along the reference keep it, as measured without the band's own constraints."""
    band = one_lane(ElasticBand(), found, speed=speed)
    assert len(band.blocked) == 0
    assert np.abs(band.d).max() > 0.3
    assert least_distance(band, found) >= 0.49
    # The band stays in its free space, and on the centre line away from obstacles.
    assert band.d.max() <= 5.25 - 0.5 * WIDTH + 0.02
    assert band.d.min() >= -(1.75 - 0.5 * WIDTH) - 0.02
    if speed == 5.0:
        assert np.abs(band.d[:60]).max() < 0.02
        assert np.abs(band.d[250:]).max() < 0.02


def test_swerves_are_comfortable_at_the_speed_of_the_lane() -> None:
    """The greatest curvature is about D / (t v)^2: the lateral acceleration D / t^2 at v."""
    for speed in (5.0, 10.0, 20.0, 30.0):
        band = one_lane(ElasticBand(), obstacles((150.0, 0.0, 2.25, 0.9)), speed=speed)
        assert np.abs(band.curvature).max() * speed ** 2 <= 1.1 * 2.4 / 1.2 ** 2
        # The curvature, summed twice, is the offset again.
        again = np.cumsum(np.cumsum(band.curvature)) + band.d[0] * np.arange(2, S + 2)
        np.testing.assert_allclose(again[:-1], band.d[1:], atol=1e-9)


def test_a_lane_without_room_is_blocked_at_the_near_edge() -> None:
    """Behind the blockage a second obstacle is still avoided."""
    band = one_lane(ElasticBand(), obstacles((100.0, 0.2, 2.5, 1.0), (220.0, -1.4, 2.5, 0.8)),
                    left=1.75)
    assert band.blocked == [97.5]
    assert np.abs(band.d[90:110]).max() < 0.2
    assert band.d[220] >= 0.7


def test_less_than_the_wanted_clearance_is_taken_before_the_lane_is_blocked() -> None:
    """Room for 0.3 m: passed with 0.3 m, or blocked if 0.5 m is a must; for 0.1 m: blocked."""
    for room, blocked in ((0.3, False), (0.1, True)):
        # Between the right edge of the way at 2 m and an obstacle that begins at 2 - 2 - room.
        found = obstacles((150.0, -0.5 - room, 2.5, 0.5))
        band = one_lane(ElasticBand(), found, left=2.0, right=1.75)
        assert (len(band.blocked) == 1) == blocked
        if not blocked:
            assert least_distance(band, found) == pytest.approx(room, abs=0.01)
    strict = ElasticBand(min_clearance=0.5)
    assert one_lane(strict, obstacles((150.0, -0.8, 2.5, 0.5)), left=2.0).blocked == [147.5]


@pytest.mark.parametrize(('d', 'left', 'right', 'side'), [
    (0.3, 5.0, 5.0, -1.0), (-0.3, 5.0, 5.0, 1.0), (0.0, 5.0, 5.0, 1.0), (0.0, 4.0, 5.0, -1.0),
    (0.0, 5.0, 4.0, 1.0), (1.6, 9.0, 1.75, -1.0)])
def test_the_nearer_side_is_taken_then_the_one_with_more_room(
        d: float, left: float, right: float, side: float) -> None:
    """With equal room on both sides the band goes left."""
    band = one_lane(ElasticBand(), obstacles((150.0, d, 2.0, 0.5)), left=left, right=right)
    assert np.sign(band.d[150]) == side
    # The band bulges a little between the points where it touches.
    assert abs(band.d[150]) == pytest.approx(0.5 + 1.5 - abs(d), abs=0.06)


@pytest.mark.slow
def test_the_band_has_the_least_energy() -> None:
    """Scipy solves the bounded least squares min |d - m^2 d''|, low <= d <= high, equally."""
    rng = np.random.default_rng(7)
    n = 160
    for _ in range(12):
        stiffness = float(rng.uniform(16.0, 600.0))
        low, high = np.full(n, -0.75), np.full(n, 4.25)
        for first in rng.integers(40, 110, 3):
            part = slice(int(first), int(first + rng.integers(4, 16)))
            edge = rng.uniform(0.2, 2.5)
            low[part] = np.maximum(low[part], edge)
        bend = np.zeros((n + 2, n))
        for i in range(n):
            bend[i:i + 3, i] = (-stiffness, 1.0 + 2.0 * stiffness, -stiffness)
        exact = lsq_linear(bend, np.zeros(n + 2), (low, high), method='bvls', tol=1e-12)
        got = _band(low, high, stiffness)
        assert 0.5 * np.sum((bend @ got) ** 2) <= exact.cost * (1.0 + 1e-3) + 1e-6
        np.testing.assert_allclose(got, exact.x, atol=5e-3)
        assert (got - low).min() > -2e-3


def test_a_slalom_too_tight_for_a_car_is_blocked_where_it_is() -> None:
    """Over 30 m agents drive it; over 9 m it bends more than a turning circle: one blocks."""
    for distance, blocked in ((30.0, False), (9.0, True)):
        found = obstacles((100.0, -1.0, 0.2, 0.8), (100.0 + distance, 3.0, 0.2, 2.2))
        band = one_lane(ElasticBand(), found, speed=8.0)
        assert (len(band.blocked) == 1) == blocked
        assert np.abs(band.curvature).max() <= 0.15
        if blocked:
            assert band.blocked[0] in (99.8, 108.8)
        else:
            assert least_distance(band, found) >= 0.49


def test_between_two_obstacles_the_middle_is_taken_where_it_is_nearest() -> None:
    """Parked cars on both sides leave 3.4 m: the lane goes through, not around both."""
    found = obstacles((150.0, 2.9, 2.5, 1.0), (150.0, -2.5, 2.5, 1.0))
    band = one_lane(ElasticBand(), found, left=8.0, right=8.0)
    assert np.abs(band.d).max() < 0.5
    assert least_distance(band, found) >= 0.49


def test_ends_stay_on_the_centre_line_and_what_cannot_be_bent_is_blocked() -> None:
    """An obstacle at the very start of a lane leaves no distance to swerve."""
    near, far = obstacles((3.0, 0.0, 1.0, 0.8)), obstacles((40.0, 0.0, 1.0, 0.8))
    assert one_lane(ElasticBand(), near).blocked == [2.0]
    band = one_lane(ElasticBand(), far)
    assert len(band.blocked) == 0
    assert np.abs(band.curvature).max() <= 0.15
    assert abs(band.d[0]) < 0.1


def test_random_obstacles_are_avoided_or_the_lane_is_blocked() -> None:
    """300 cases of up to 6 boxes: lanes that are not blocked keep the bends and clearances."""
    rng = np.random.default_rng(11)
    planner = ElasticBand()
    passed = 0
    for _ in range(300):
        count = int(rng.integers(1, 7))
        found = obstacles(*zip(
            rng.uniform(30.0, 270.0, count), rng.uniform(-3.0, 5.0, count),
            rng.uniform(0.2, 6.0, count), rng.uniform(0.2, 1.2, count), strict=True))
        band = one_lane(planner, found, speed=float(rng.uniform(3.0, 30.0)))
        assert np.abs(band.curvature).max() <= 0.15 + 1e-9
        if len(band.blocked):
            continue
        passed += 1
        nodes = np.arange(S)
        for s, d, length, width in zip(*found, strict=True):
            beside = np.abs(nodes - s) <= length + 0.5 * LENGTH
            sides = np.abs(band.d[beside] - d) - width - 0.5 * WIDTH
            assert sides.min() >= 0.17
    assert passed > 200


@pytest.mark.parametrize(('side', 'clearance'), [
    # An obstacle leaves 3.25, 3.15, 2.85 or 2.55 m of a lane: of what 2.5 m leave over the
    # clearance is up to 0.5 m; where less than 0.2 m are left the band is for cars.
    (-1.375, {2.5: 0.5, 2.0: 0.75}), (-1.275, {2.5: 0.5, 2.0: 0.75}),
    (-0.975, {2.5: 0.35, 2.0: 0.6}), (-0.675, {2.0: 0.5}), (0.0, {})])
def test_a_band_is_for_the_widest_where_they_have_room(side: float,
                                                       clearance: dict[float, float]) -> None:
    found = obstacles((150.0, side - 0.5, 2.0, 0.5))
    for wide in (True, False):
        planner = ElasticBand(wide_half_width=1.25) if wide else ElasticBand()
        band = one_lane(planner, found, left=1.875, right=1.875)
        assert len(band.blocked) == (not clearance)
        beside = band.d[146:155].min() - side
        for width, least in clearance.items() if wide else ():
            assert beside - 0.5 * width == pytest.approx(least, abs=0.02)


def test_what_is_too_tight_for_the_widest_is_left_to_cars() -> None:
    # A slalom that a way for 2 m of width bends through; for 3 m its curvature would be 0.12 / m.
    found = obstacles(*((130.0 + 9.0 * i, (-1) ** i * 2.3, 0.3, 1.1) for i in range(4)))
    cars, both = (one_lane(ElasticBand(max_curvature=0.1, wide_half_width=half), found, left=3.4,
                           right=3.4) for half in (None, 1.5))
    assert len(cars.blocked) == 0 and np.abs(cars.d).max() > 1.0
    np.testing.assert_array_equal(both.d, cars.d)
    np.testing.assert_array_equal(both.blocked, cars.blocked)


def test_the_same_question_has_the_same_answer() -> None:
    """In the same plan and the next one no band is bent again; later, bit for bit the same."""
    first, second = obstacles((150.0, 0.0, 2.0, 0.8)), obstacles((160.0, 0.0, 2.0, 0.8))
    planner = ElasticBand()
    answers = [one_lane(planner, found) for found in (first, second, first)]
    planner.begin_plan()
    assert one_lane(planner, first) is answers[2] is answers[0]
    assert not np.array_equal(answers[0].d, answers[1].d)
    planner.begin_plan()
    assert one_lane(planner, second) is not answers[1]
    np.testing.assert_array_equal(one_lane(planner, second).d, answers[1].d)
    wider = one_lane(planner, first, left=2.6)
    assert wider.d.max() < 0.0 or len(wider.blocked) == 1


@pytest.mark.parametrize('options', [{'step': 0.0}, {'min_clearance': 0.6}, {'band_time': -1.0}],
                         ids=['step', 'clearance', 'time'])
def test_impossible_options_are_refused(options: dict[str, float]) -> None:
    with pytest.raises(InputError, match='elastic band'):
        ElasticBand(**options)
