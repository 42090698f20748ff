# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Lanes of way-points (FS 1) against closed forms, finite differences and dense searches."""

from collections.abc import Callable
import math
from pathlib import Path
import time

from crgame_ros.errors import InputError
from crgame_ros.paths import scenarios_directory
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.waypoints.roads import WaypointRoads
from crgame_ros.waypoints.waypoints import WaypointLane
import numpy as np
from numpy.typing import NDArray
import pytest
import shapely

Array = NDArray[np.float64]
SHARED = Path(__file__).resolve().parents[3] / 'shared' / 'scenarios'


def lane_of(points: Array, width: float = 3.5, limit: float = 13.9) -> WaypointLane:
    """Build a lane of constant width and limit."""
    count = len(points)
    return WaypointLane(points[:, 0], points[:, 1], np.full(count, width), np.full(count, limit))


def circle(radius: float, count: int, angle: float = 1.5 * math.pi) -> Array:
    """Sample a left turn that starts at the origin towards +x."""
    phi = np.linspace(0.0, angle, count)
    return np.stack((radius * np.sin(phi), radius * (1.0 - np.cos(phi))), axis=-1)


def test_stations_are_the_lengths_of_the_straight_lines() -> None:
    """A 3-4-5 triangle and a 5-12-13 triangle end to end: 0, 5, 18 m (FS II-A1)."""
    lane = lane_of(np.array([[1.0, 1.0], [4.0, 5.0], [16.0, 0.0]]))
    assert lane.s.tolist() == [0.0, 5.0, 18.0]
    assert lane.length == 18.0


@pytest.mark.parametrize('axis', [0, 1], ids=['x', 'y'])
def test_cubics_are_reproduced_exactly(axis: int) -> None:
    """A coordinate that is a cubic of the station is that cubic between the way-points too."""
    cubic = np.polynomial.Polynomial([2.0, 0.3, -0.01, 1.5e-4])
    s = np.cumsum([0.0, 3.0, 4.0, 2.5, 6.0, 5.0, 7.0, 4.0, 3.0])
    values = cubic(s)
    # The other coordinate makes the lengths of the straight lines equal the stations.
    other = np.concatenate(([0.0], np.cumsum(np.sqrt(np.diff(s)**2 - np.diff(values)**2))))
    lane = lane_of(np.stack((values, other) if axis == 0 else (other, values), axis=-1))
    assert lane.s == pytest.approx(s, abs=1e-12)
    dense = np.linspace(0.0, s[-1], 1001)
    assert lane.at(dense)[axis] == pytest.approx(cubic(dense), abs=1e-11)
    assert lane.tangents(dense)[:, axis] == pytest.approx(cubic.deriv()(dense), abs=1e-11)


def test_curvature_of_a_circle_converges() -> None:
    """1 / R everywhere; the error falls with the square of the spacing, at the ends too."""
    errors = {}
    for count in (20, 40, 80, 160):
        lane = lane_of(circle(25.0, count))
        curvature = lane.at(np.linspace(0.0, lane.length, 2003)).curvature
        errors[count] = float(np.abs(curvature * 25.0 - 1.0).max())
    # 6.2 m between way-points: within 5 %; 0.74 m: within a thousandth.
    assert errors[20] < 0.05
    assert errors[160] < 1e-3
    for count in (20, 40, 80):
        assert errors[count] / errors[2 * count] > 3.5
    right = lane_of(circle(25.0, 160) * (1.0, -1.0))
    assert right.at(np.array([50.0])).curvature[0] == pytest.approx(-1.0 / 25.0, rel=1e-3)


def test_heading_is_the_direction_of_motion() -> None:
    """Heading and curvature agree with finite differences of the positions."""
    rng = np.random.default_rng(3)
    points = np.cumsum(rng.uniform((1.0, -1.5), (4.0, 1.5), (30, 2)), axis=0)
    lane = lane_of(points)
    s, h = np.linspace(0.5, lane.length - 0.5, 700), 1e-4
    here, before, after = lane.at(s), lane.at(s - h), lane.at(s + h)
    heading = np.arctan2(after.y - before.y, after.x - before.x)
    assert np.abs(np.angle(np.exp(1j * (here.yaw - heading)))).max() < 1e-6
    turned = np.angle(np.exp(1j * (after.yaw - before.yaw)))
    moved = np.hypot(after.x - before.x, after.y - before.y)
    assert here.curvature == pytest.approx(turned / moved, abs=1e-4)


def test_steps_jump_at_their_way_points() -> None:
    """X(s) = X^i from s^i on up to the next way-point (FS 1), and on beyond the ends."""
    x = np.array([0.0, 10.0, 30.0, 40.0])
    lane = WaypointLane(x, 0.0 * x, np.array([3.0, 4.0, 3.5, 3.5]),
                        np.array([10.0, np.inf, 5.0, 7.0]), {'width': 'step'})
    s = np.array([-5.0, 0.0, 9.999, 10.0, 29.999, 30.0, 39.999, 40.0, 99.0])
    assert lane.at(s).speed_limit.tolist() == [10, 10, 10, np.inf, np.inf, 5, 5, 7, 7]
    assert lane.at(s).width.tolist() == [3, 3, 3, 4, 4, 3.5, 3.5, 3.5, 3.5]


def test_cubic_quantities_stay_between_their_way_points() -> None:
    """A taper to 0 and a lower limit do not overshoot, and slopes have no jumps."""
    x = np.array([0.0, 10.0, 20.0, 21.0, 40.0])
    lane = WaypointLane(x, 0.0 * x, np.array([3.5, 3.5, 0.0, 0.0, 4.0]),
                        np.array([20.0, 20.0, 8.0, 8.0, 8.0]),
                        {'width': 'cubic', 'speed_limit': 'cubic'})
    dense = np.linspace(0.0, 40.0, 4001)
    here = lane.at(dense)
    assert here.width.min() == 0.0 and here.width.max() == pytest.approx(4.0)
    assert here.speed_limit.min() == 8.0 and here.speed_limit.max() == 20.0
    assert lane.at(x).width.tolist() == pytest.approx([3.5, 3.5, 0.0, 0.0, 4.0], abs=1e-12)
    slope = np.diff(here.width) / 0.01
    assert np.abs(np.diff(slope)).max() < 0.02
    # Half-way between two way-points with flat ends, a cubic is at the mean.
    assert lane.at(np.array([15.0])).speed_limit[0] == pytest.approx(14.0)


def test_beyond_the_ends_it_is_clamped() -> None:
    """Stations are limited; a point beyond an end projects on the end."""
    lane = lane_of(circle(25.0, 40, 1.0))
    ends = lane.at(np.array([-3.0, 0.0, lane.length, lane.length + 3.0]))
    assert ends.x[0] == ends.x[1] and ends.x[2] == ends.x[3]
    found = lane.project(np.array([[-4.0, 2.0], [-4.0, -1.0]]))
    assert found.s.tolist() == [0.0, 0.0]
    # The lane starts towards +x within the spline's error.
    assert found.d == pytest.approx([2.0, -1.0], abs=0.01)


def test_projection_inverts_poses() -> None:
    """Within the radius of the bends, s and d come back to a micrometre, d with its sign."""
    lane = lane_of(circle(25.0, 60))
    rng = np.random.default_rng(5)
    s, d = rng.uniform(0.0, lane.length, 500), rng.uniform(-20.0, 20.0, 500)
    found = lane.project(lane.poses(s, d)[:, :2])
    assert found.s == pytest.approx(s, abs=1e-6)
    assert found.d == pytest.approx(d, abs=1e-6)


def test_curves_that_come_back_to_themselves() -> None:
    """A figure of eight crosses itself; the nearer branch counts."""
    phi = np.linspace(0.1, 2.0 * math.pi - 0.1, 90)
    lane = lane_of(np.stack((40.0 * np.sin(phi), 25.0 * np.sin(2.0 * phi)), axis=-1))
    points = np.random.default_rng(6).uniform(-45.0, 45.0, (1500, 2))
    assert_nearest(lane, points)


def assert_nearest(lane: WaypointLane, points: Array) -> None:
    """Check distances against those to the lane sampled every 2 cm, as straight lines."""
    dense = lane.at(np.linspace(0.0, lane.length, math.ceil(lane.length / 0.02) + 1))
    line = shapely.LineString(np.stack((dense.x, dense.y), axis=-1))
    found = lane.project(points)
    at = lane.at(found.s)
    distance = np.hypot(points[:, 0] - at.x, points[:, 1] - at.y)
    assert np.abs(distance - shapely.distance(shapely.points(points), line)).max() < 1e-3
    inside = (found.s > 0.0) & (found.s < lane.length)
    assert np.abs(found.d[inside]) == pytest.approx(distance[inside], abs=1e-6)


@pytest.mark.exhaustive
@pytest.mark.parametrize('directory', [scenarios_directory(), SHARED], ids=['own', 'published'])
def test_projection_against_dense_search_on_maps(directory: Path) -> None:
    """On every lane of every map, for points up to 20 m beside its way-points."""
    files = sorted(directory.glob('*.xml'))
    if not files:
        pytest.skip('the real scenarios (../shared/scenarios) are not on this machine')
    rng = np.random.default_rng(7)
    for file in files:
        network = RoadNetwork(load_scenario(file).scenario.lanelet_network)
        roads = WaypointRoads.from_lanelets(network)
        for lane in map(roads.lane, roads.lane_ids):
            near = lane.points[rng.integers(len(lane.points), size=60)]
            assert_nearest(lane, near + rng.uniform(-20.0, 20.0, near.shape))


def seconds(function: Callable[[], object]) -> float:
    """Return the time of the fastest of several calls."""
    times = []
    for _ in range(7):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def test_projection_costs_the_logarithm_of_the_length() -> None:
    """A hundred times as many way-points take less than five times as long, in the same run."""
    rng = np.random.default_rng(8)
    taken = []
    for count in (1_000, 100_000):
        x = np.arange(count, dtype=np.float64)
        lane = lane_of(np.stack((x, 30.0 * np.sin(x / 60.0)), axis=-1))
        places = lane.poses(rng.uniform(0.0, lane.length, 1500), rng.uniform(-5.0, 5.0, 1500))
        lane.project(places[:1, :2])
        taken.append(seconds(lambda lane=lane, places=places: lane.project(places[:, :2])))
    assert taken[1] / taken[0] < 5.0


def test_repeated_way_points_are_one() -> None:
    """The last one's values count, so that a step may stand at a doubled way-point."""
    lane = WaypointLane(np.array([0.0, 10.0, 10.0, 20.0]), np.zeros(4), np.full(4, 3.0),
                        np.array([5.0, 5.0, 9.0, 9.0]))
    assert lane.s.tolist() == [0.0, 10.0, 20.0]
    assert lane.at(np.array([9.9, 10.0])).speed_limit.tolist() == [5.0, 9.0]


@pytest.mark.parametrize(('change', 'message'), [
    ({'x': [0.0, math.nan]}, '"x" of way-point 1 is nan'),
    ({'y': [0.0, math.inf]}, '"y" of way-point 1 is inf'),
    ({'width': [3.0, -0.1]}, '"width" of way-point 1 is -0.1'),
    ({'speed_limit': [0.0, 3.0]}, '"speed_limit" of way-point 0 is 0'),
    ({'width': [3.0]}, 'one for each way-point'),
    ({'x': [1.0, 1.0]}, 'all way-points are the same'),
    ({'x': [1.0]}, 'there is 1 way-point'),
    ({'kinds': {'width': 'linear'}}, 'use cubic or step'),
    ({'kinds': {'x': 'step'}}, 'no choice of interpolation'),
    ({'speed_limit': [math.inf, 3.0], 'kinds': {'speed_limit': 'cubic'}}, 'one at every'),
], ids=lambda value: value[:20] if isinstance(value, str) else '')
def test_what_is_no_lane_is_refused(change: dict[str, object], message: str) -> None:
    """Each message names the quantity, the way-point and the value."""
    values = {'x': [0.0, 10.0], 'y': [0.0, 0.0], 'width': [3.0, 3.0], 'speed_limit': [9.0, 9.0]}
    with pytest.raises(InputError, match=message):
        WaypointLane(**{**values, **change})
