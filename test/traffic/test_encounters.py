# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which vehicles are in the way, and how hard agents brake for them; checked with shapely."""

from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.traffic.fleet.agents import Agents, centers_of
from crgame_ros.traffic.following.encounters import BEFORE, BESIDE, FIRMEST, needed_braking
from crgame_ros.traffic.lanes.lane_graph import LaneGraph
import numpy as np
import pytest
import traffic_support as support

HORIZON, STEP = 3.0, 0.05


def crossing(angle: float) -> LaneGraph:
    """Make a lane to the east through the origin and one at an angle to it."""
    ahead = np.array((np.cos(angle), np.sin(angle)))
    return LaneGraph(RoadNetwork(support.roads(
        support.lane_strip(1, [(-100.0, 0.0), (100.0, 0.0)]),
        support.lane_strip(2, [tuple(-100.0 * ahead), tuple(100.0 * ahead)])).lanelet_network))


def meeting(graph: LaneGraph, places: list[float], speeds: list[float]) -> Agents:
    """Make a car in each of the lanes, at the given distances from the crossing."""
    agents = Agents([ObjectDescription(f't{i}', 'car', Role.TRAFFIC, support.CAR)
                     for i in range(2)])
    for i, (place, speed) in enumerate(zip(places, speeds, strict=True)):
        s = 100.0 - place
        x, y, yaw = graph.poses(np.array([i]), np.array([s]), np.zeros(1))[0]
        agents.put(i, i, s, 0.0, (float(x), float(y), float(yaw)), speed)
    return agents


def touch(agents: Agents, braking: float, room: float) -> bool:
    """Return whether two cars that drive straight on touch, the first of them braking."""
    poses, velocities = centers_of(agents.table, np.arange(2))[0], agents.speed
    for t in np.arange(STEP, HORIZON + STEP, STEP):
        shapes = []
        for i, slows in ((0, braking), (1, 0.0)):
            time = min(t, velocities[i] / slows) if slows > 0.0 else t
            way = velocities[i] * time - 0.5 * slows * time**2
            shapes.append(support.rectangle(
                poses[i] + way * np.array((np.cos(poses[i, 2]), np.sin(poses[i, 2]), 0.0)),
                4.5 + 2.0 * room * BEFORE, 1.8 + 2.0 * room))
        if shapes[0].intersects(shapes[1]):
            return True
    return False


@pytest.mark.matrix('2.3')
@pytest.mark.slow
@pytest.mark.parametrize('angle', [1.57, 2.3, -0.9, 3.0])
def test_nothing_is_braked_for_that_passes(angle: float) -> None:
    """100 meetings at a crossing: the braking separates the two, and is no harder than needed."""
    graph, rng = crossing(angle), np.random.default_rng(5)
    following = np.full((1, 2), -1, dtype=np.int64)
    passed = parted = 0
    for _ in range(100):
        agents = meeting(graph, rng.uniform(8.0, 40.0, 2).tolist(),
                         rng.uniform(2.0, 14.0, 2).tolist())
        braking = needed_braking(graph.table, following, agents.table, 0, 1)
        if braking == -np.inf:
            passed += 1
            assert not touch(agents, 0.0, 0.0)
            continue
        # It is at least close, and the braking helps as far as any braking does.
        assert touch(agents, 0.0, 1.2 * BESIDE)
        if braking > FIRMEST:
            # Only contact itself is worth more than firm braking.
            assert touch(agents, 0.0, 0.0)
        if braking not in (8.0, FIRMEST):
            parted += 1
            assert not touch(agents, braking, 0.0)
            assert braking == 2.0 or touch(agents, 0.8 * braking - 0.8, 1.2 * BESIDE)
    assert passed > 20 and (parted > 0 or abs(angle) > 2.9)


def test_no_agent_brakes_for_a_pedestrian_that_arrives_after_it() -> None:
    """A pedestrian 8 m ahead that walks towards the road gets there 1.5 s later."""
    road = support.roads(support.straight_lane(1, 0.0, 0.0, 300.0))
    hardest = []
    for beside in (4.5, 1.5):
        walker = support.human(73.0, beside, -np.pi / 2.0, 1.4, since=10, kind='pedestrian',
                               shape=support.Shape.rectangle(0.5, 0.5))
        car = support.driving(1, [(50.0, 0.0, 0.0), (290.0, 0.0, 0.0)], 13.0)
        run = support.Run(road, TrafficSpec(), 0, [walker], [car]).ticks(30)
        _, speeds = run.series(0)
        hardest.append(float(np.max(speeds[:-1] - speeds[1:]) / 0.1))
    assert hardest[0] < 0.5
    assert hardest[1] > 3.0


def test_a_pedestrian_far_ahead_is_waited_for_gently() -> None:
    road = support.roads(support.straight_lane(1, 0.0, 0.0, 300.0))
    walker = support.human(90.0, 5.5, -np.pi / 2.0, 1.0, kind='pedestrian',
                           shape=support.Shape.rectangle(0.5, 0.5))
    car = support.driving(1, [(20.0, 0.0, 0.0), (290.0, 0.0, 0.0)], 13.0)
    run = support.Run(road, TrafficSpec(), 0, [walker], [car]).ticks(120)
    _, speeds = run.series(0)
    assert run.overlaps() == []
    assert 0.5 < np.max(speeds[:-1] - speeds[1:]) / 0.1 < 4.0


def test_creeping_up_needs_no_emergency() -> None:
    """Below the gap at standstill the law alone would brake with 8 m/s^2 from walking speed."""
    road = support.roads(support.straight_lane(1, 0.0, 0.0, 300.0))
    leader = support.human(57.0, 0.0, 0.0, 0.4)
    car = support.driving(1, [(51.5, 0.0, 0.0), (290.0, 0.0, 0.0)], 1.0)
    run = support.Run(road, TrafficSpec(), 0, [leader], [car]).ticks(40)
    _, speeds = run.series(0)
    assert run.overlaps() == []
    assert np.max(speeds[:-1] - speeds[1:]) / 0.1 < 4.0
