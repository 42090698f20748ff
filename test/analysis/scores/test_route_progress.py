# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Progress along routes, and the free drive, against closed forms."""

from pathlib import Path
import sys

from crgame_ros.analysis.scores.route_progress import ComparedRoute, progress_ratio, route_of
from crgame_ros.paths import scenarios_directory
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.route import find_route
from crgame_ros.scenario.loading import load_scenario
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from score_roads import road, straight  # noqa: E402, I100


@pytest.fixture(scope='module')
def roads() -> RoadNetwork:
    """Return the straight road with a limit of 10 m/s."""
    return RoadNetwork(road().scenario.lanelet_network)


def test_lanes_beside_are_the_same_part(roads: RoadNetwork) -> None:
    """A lane change stays on the route; the oncoming lane is off it."""
    route = ComparedRoute(roads, [1, 2])
    assert route.lanelets == [1]
    x = np.linspace(20.0, 70.0, 11)
    changing = np.column_stack((x, np.linspace(0.0, 3.5, 11)))
    assert route.progress(changing) == pytest.approx(50.0, abs=1e-9)
    assert route.progress(np.column_stack((x, np.full(11, 7.0)))) == 0.0


def test_off_the_route_nothing_is_gained(roads: RoadNetwork) -> None:
    """The way driven off it counts once the route is entered again, as in nuPlan."""
    points = np.array([(20.0, 0.0), (30.0, 0.0), (40.0, -20.0), (50.0, -20.0)])
    assert ComparedRoute(roads, [1]).progress(points) == pytest.approx(10.0)


@pytest.mark.parametrize('duration_s', [2.0, 10.0])
def test_free_way(roads: RoadNetwork, duration_s: float) -> None:
    """From rest with 2.4 m/s^2 to 10 m/s, then at that: t1 = 10 / 2.4 s."""
    rising_s = min(duration_s, 10.0 / 2.4)
    expected = 1.2 * rising_s ** 2 + 10.0 * (duration_s - rising_s)
    route = ComparedRoute(roads, [1])
    assert route.free_way(5.0, 0.0, duration_s, 1e9) == pytest.approx(expected, abs=0.02)
    assert route.free_way(5.0, 0.0, duration_s, 6.5) == pytest.approx(1.5)
    # Too fast at the start: the limit holds at once.
    assert route.free_way(5.0, 30.0, 3.0, 1e9) == pytest.approx(30.0, abs=1e-6)


@pytest.mark.parametrize(('own', 'expert', 'expected'), [
    (-2.1, 10.0, 0.0), (0.0, 0.0, 1.0), (5.0, 10.0, 0.5), (20.0, 10.0, 1.0), (-1.9, 10.0, 0.2),
    (0.5, 1.5, 1.0)])
def test_progress_ratio(own: float, expert: float, expected: float) -> None:
    """min(1, max(own, 2) / max(expert, 2)); backwards by more than 2 m nothing."""
    assert progress_ratio(own, expert) == pytest.approx(expected)


def test_a_route_over_many_lanelets_is_as_long_as_its_line() -> None:
    """Along the centre lines around a roundabout the progress is their length."""
    loaded = load_scenario(scenarios_directory() / 'ZAM_Roundabout-1_1_T-1.xml')
    roads = RoadNetwork(loaded.scenario.lanelet_network)
    start = max(roads.lanelet_ids, key=lambda each: len(
        find_route(roads, each, 0.0, frozenset(), 100.0).legs[0]))
    leg = find_route(roads, start, 0.0, frozenset(), 100.0).legs[0]
    points = np.concatenate([roads.line(each).points[1:-1] for each in leg])
    route = ComparedRoute(roads, leg)
    length = sum(roads.line(each).length for each in leg)
    assert len(leg) > 3
    assert route.progress(np.vstack((roads.line(leg[0]).points[0], points,
                                     roads.line(leg[-1]).points[-1]))) \
        == pytest.approx(length, abs=0.5)


def test_the_route_of_an_expert(roads: RoadNetwork) -> None:
    """The lanes it was in, without those it was not."""
    assert route_of(roads, straight(10.0)[0]).lanelets == [1]
    assert len(route_of(roads, straight(10.0, y=-50.0)[0])) == 0
