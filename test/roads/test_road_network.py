# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The road network against closed forms, shapely and commonroad-io's own lookups."""

import math
from pathlib import Path

from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from crgame_ros.errors import InputError
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario, LoadedScenario
import numpy as np
from numpy.typing import NDArray
import pytest
import shapely

SHARED = Path(__file__).resolve().parents[3] / 'shared' / 'scenarios'


def shared(name: str) -> LoadedScenario:
    """Load a real scenario, or skip."""
    if not (SHARED / name).exists():
        pytest.skip('the real scenarios (../shared/scenarios) are not on this machine')
    return load_scenario(SHARED / name)


def lanelet(lanelet_id: int, center: NDArray[np.float64], width: float = 4.0, *,
            successor: tuple[int, ...] = (), predecessor: tuple[int, ...] = ()) -> Lanelet:
    """Build a lanelet around a centre line."""
    direction = np.gradient(center, axis=0)
    direction /= np.hypot(*direction.T)[:, None]
    normal = np.stack((-direction[:, 1], direction[:, 0]), axis=-1) * width / 2
    return Lanelet(center + normal, center, center - normal, lanelet_id,
                   predecessor=list(predecessor), successor=list(successor))


def network_of(*lanelets: Lanelet) -> RoadNetwork:
    """Make a network without cleaning up the references."""
    return RoadNetwork(LaneletNetwork.create_from_lanelet_list(list(lanelets), cleanup_ids=False))


def straight(x0: float, x1: float, y: float = 0.0, points: int = 5) -> NDArray[np.float64]:
    """Sample a straight centre line."""
    return np.stack((np.linspace(x0, x1, points), np.full(points, y)), axis=-1)


def arc(radius: float, angle: float, points: int = 200) -> NDArray[np.float64]:
    """Sample a left turn that starts at the origin towards +x."""
    phi = np.linspace(0.0, angle, points)
    return np.stack((radius * np.sin(phi), radius * (1.0 - np.cos(phi))), axis=-1)


def test_arc_agrees_with_the_circle() -> None:
    """On a circle of 30 m, s is R phi, yaw is phi, and d moves the point to radius R - d."""
    road = network_of(lanelet(1, arc(30.0, math.pi / 2)))
    phi, d = 0.7, 1.2
    x, y, yaw = road.pose_on(1, 30.0 * phi, d)
    assert (x, y) == pytest.approx((28.8 * math.sin(phi), 30.0 - 28.8 * math.cos(phi)), abs=2e-3)
    assert yaw == pytest.approx(phi, abs=1e-4)
    s, offset = road.locate(1, 28.8 * math.sin(phi), 30.0 - 28.8 * math.cos(phi))
    assert (s, offset) == pytest.approx((30.0 * phi, d), abs=2e-3)
    assert road.width_at(1, 10.0) == pytest.approx(4.0, abs=1e-3)
    points, arc_length = road.line(1).points, road.line(1).s
    assert len(points) == len(arc_length) == 200
    assert arc_length[-1] == pytest.approx(15.0 * math.pi, abs=1e-3)


@pytest.mark.matrix('USA_Lanker-1_3_T-1.xml')
@pytest.mark.parametrize('name', ['DEU_Flensburg-10_1_T-1.xml', 'USA_Lanker-1_3_T-1.xml'])
def test_locate_inverts_pose_on(name: str) -> None:
    """On real lanes the round trip is exact to a micrometre, beyond the ends too."""
    road = RoadNetwork(shared(name).scenario.lanelet_network)
    rng = np.random.default_rng(1)
    worst = 0.0
    for lanelet_id in road.lanelet_ids:
        length = road.line(lanelet_id).length
        for s, d in zip(rng.uniform(-2.0, length + 2.0, 10), rng.uniform(-1, 1, 10), strict=True):
            x, y, _ = road.pose_on(lanelet_id, s, d)
            found = road.pose_on(lanelet_id, *road.locate(lanelet_id, x, y))
            worst = max(worst, math.dist((x, y), found[:2]))
    assert worst < 1e-6


@pytest.mark.parametrize('name', ['USA_Lanker-1_3_T-1.xml', 'DEU_Guetersloh-36_1_T-1.xml'])
def test_lanelet_at_agrees_with_commonroad(name: str) -> None:
    """The lanelet found is one of `find_lanelet_by_position`, and None where that is empty."""
    network = shared(name).scenario.lanelet_network
    road = RoadNetwork(network)
    rng = np.random.default_rng(2)
    everything = np.concatenate([x.center_vertices for x in network.lanelets])
    points = rng.uniform(everything.min(axis=0), everything.max(axis=0), (400, 2))
    # Not the vertices themselves: at a lanelet's end, rounding decides on which side they are.
    points = np.concatenate((points, rng.choice(everything, 400) + rng.normal(0, 0.1, (400, 2))))
    expected = network.find_lanelet_by_position(list(points))
    assert 100 < sum(not e for e in expected) < 400
    for (x, y), lanelets in zip(points, expected, strict=True):
        found = road.lanelet_at(x, y)
        assert found in lanelets if lanelets else found is None


def test_heading_decides_between_overlapping_lanelets() -> None:
    """In every overlap, a lanelet's own direction finds a lanelet that agrees as well."""
    road = RoadNetwork(shared('USA_Lanker-1_3_T-1.xml').scenario.lanelet_network)
    crossing = 0
    for lanelet_id in road.lanelet_ids:
        x, y, yaw = road.pose_on(lanelet_id, road.line(lanelet_id).length / 2)
        found = road.lanelet_at(x, y, yaw)
        assert found is not None
        other = road.pose_on(found, road.locate(found, x, y)[0])[2]
        assert abs(math.remainder(other - yaw, math.tau)) < math.radians(25.0)
        crossing += road.lanelet_at(x, y, yaw + math.pi / 2) != found
    assert crossing > 10


def test_many_lookups_equal_single_ones() -> None:
    """The vectorised look-up equals the scalar one."""
    road = RoadNetwork(shared('USA_Lanker-1_3_T-1.xml').scenario.lanelet_network)
    rng = np.random.default_rng(3)
    points = np.concatenate([road.line(i).points for i in road.lanelet_ids])
    poses = np.column_stack((points + rng.normal(0.0, 3.0, points.shape),
                             rng.uniform(-3.0, 3.0, len(points))))
    for pose, found in zip(poses, road.lanelets_at(poses), strict=True):
        single = road.lanelet_at(*pose)
        assert single == (None if found < 0 else road.lanelet_ids[found])


def test_nearest_lanelet_is_nearest_by_shapely() -> None:
    """Off the road, the distance to the found polygon is the least of all."""
    network = shared('DEU_Guetersloh-36_1_T-1.xml').scenario.lanelet_network
    road = RoadNetwork(network)
    rng = np.random.default_rng(4)
    points = rng.choice(network.lanelets[0].center_vertices, 50) + rng.uniform(-80, 80, (50, 2))
    for x, y in points:
        distances = {i.lanelet_id: i.polygon.shapely_object.distance(shapely.Point(x, y))
                     for i in network.lanelets}
        assert distances[road.nearest_lanelet(x, y)] == pytest.approx(min(distances.values()))


def test_lane_path_takes_the_straightest_successor() -> None:
    """At a fork of a left arc and a straight road the path goes straight, to the map's end."""
    left = arc(20.0, math.pi / 2) + (50.0, 0.0)
    road = network_of(lanelet(1, straight(0, 50), successor=(2, 3)), lanelet(2, left),
                      lanelet(3, straight(50, 90), successor=(4,)), lanelet(4, straight(90, 99)))
    assert road.lane_path(1, 30.0)[-1].tolist() == [90.0, 0.0]
    assert road.lane_path(1, 1000.0)[-1].tolist() == [99.0, 0.0]
    assert road.lane_path(1, 0.0)[-1].tolist() == [50.0, 0.0]
    assert road.advance(1, 10.0, 85.0) == (4, 5.0)
    assert road.advance(1, 10.0, 1000.0) is None


def test_false_successors_are_not_followed() -> None:
    """A successor that starts elsewhere, or is the lanelet itself, is none (published maps)."""
    loaded = shared('ZAM-Ramp-1_1-T-1.xml')
    assert loaded.scenario.lanelet_network.find_lanelet_by_id(2).successor == [2]
    road = RoadNetwork(loaded.scenario.lanelet_network)
    assert road.straightest_successor(2) is None
    for lanelet_id in road.lanelet_ids:
        steps = np.hypot(*np.diff(road.lane_path(lanelet_id, 300.0), axis=0).T)
        longest = np.diff(road.line(lanelet_id).s).max()
        assert steps.max() < max(longest, 2.5)


def test_lane_path_goes_round_a_ring() -> None:
    """On a ring of two lanelets the path ends after the requested length."""
    half = arc(20.0, math.pi)
    back = (0.0, 40.0) - half
    road = network_of(lanelet(1, half, successor=(2,)), lanelet(2, back, successor=(1,)))
    path = road.lane_path(1, 200.0)
    length = np.hypot(*np.diff(path, axis=0).T).sum()
    assert 200.0 <= length - 20.0 * math.pi < 200.0 + 20.0 * math.pi


def test_neighbours_are_those_of_the_same_direction() -> None:
    """Only neighbours with drivingDir same count."""
    loaded = shared('USA_Lanker-1_3_T-1.xml')
    road = RoadNetwork(loaded.scenario.lanelet_network)
    assert (road.left_of(3608), road.right_of(3608)) == (3606, 3610)
    opposite = next(x for x in loaded.scenario.lanelet_network.lanelets
                    if x.adj_left is not None and not x.adj_left_same_direction)
    assert road.left_of(opposite.lanelet_id) is None


def test_speed_limit_of_a_real_sign() -> None:
    """FRA_Anglet's sign says 13.888… m/s, which is 50 km/h; elsewhere there is none."""
    loaded = shared('FRA_Anglet-1_1_T-1.xml')
    road = RoadNetwork(loaded.scenario.lanelet_network)
    assert road.speed_limit(85819) == pytest.approx(50.0 / 3.6)
    empty = RoadNetwork(shared('ZAM_Tutorial-1_2_T-1.xml').scenario.lanelet_network)
    assert {empty.speed_limit(i) for i in empty.lanelet_ids} == {None}


def test_unknown_lanelet_is_refused() -> None:
    """A lanelet id comes from a game file: the message names it."""
    with pytest.raises(InputError, match='no lanelet 99'):
        network_of(lanelet(1, straight(0, 50))).pose_on(99, 0.0)


def test_two_thousand_lanelets_are_found_right() -> None:
    """On a grid of 2,000 parallel lanelets the answer follows from the coordinates."""
    road = network_of(*(lanelet(row * 50 + column + 1, straight(column * 20, column * 20 + 20,
                                                                4.0 * row))
                        for row in range(40) for column in range(50)))
    assert len(road.lanelet_ids) == 2000
    for row, column in ((0, 0), (17, 33), (39, 49)):
        assert road.lanelet_at(column * 20 + 7.0, 4.0 * row + 1.0) == row * 50 + column + 1
    assert road.lanelet_at(-5.0, 0.0) is None
