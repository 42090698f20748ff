# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Indicators of AVs on made roads: where they begin and end, and on the oncoming lane."""

from commonroad.common.util import Interval
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.state import CustomState, InitialState
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.turns import Turns
from crgame_ros.simulation.plan_indicator import PlanIndicator
from crgame_ros.vehicle.lights import Light
from made_roads import made, Piece, WIDTH
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]


def indicator_on(roads: RoadNetwork, goal: int) -> PlanIndicator:
    """Make the indicator of a vehicle that begins at the origin, with a lanelet as its goal."""
    state = InitialState(time_step=0, position=np.zeros(2), orientation=0.0, velocity=10.0,
                         acceleration=0.0, yaw_rate=0.0, slip_angle=0.0)
    region = GoalRegion([CustomState(time_step=Interval(0, 100))], {0: [goal]})
    return PlanIndicator(roads, Turns(roads), PlanningProblem(1, state, region), np.zeros(3))


def plan(x: Array, y: Array) -> Array:
    """Make poses of a plan."""
    return np.column_stack((x, y, np.arctan2(np.gradient(y), np.gradient(x))))


def two_lanes() -> RoadNetwork:
    """Make a road to the east with lanes 1 and, to the left of it, 2."""
    return made({1: Piece((0.0, 0.0, 0.0), 300.0, left=2),
                 2: Piece((0.0, WIDTH, 0.0), 300.0, right=1)})


def test_a_vehicle_that_settles_beside_the_middle_has_changed_lanes() -> None:
    """0.5 m beside it: the light is on up to there, and off once the plan stays there."""
    indicator = indicator_on(two_lanes(), 1)
    x = np.arange(0.0, 300.0, 5.0)
    y = (WIDTH - 0.5) * 0.5 * (1.0 - np.cos(np.pi * np.clip((x - 20.0) / 60.0, 0.0, 1.0)))
    way, shown = plan(x, y), {}
    for first in range(len(way) - 10):
        indicator.update(way[first:first + 11])
        shown[int(x[first])] = indicator.shown
    assert {bits for at, bits in shown.items() if 10 <= at <= 65} == {Light.LEFT}
    assert {bits for at, bits in shown.items() if at >= 85} == {0}


def test_a_vehicle_held_up_between_lanes_goes_on_indicating() -> None:
    """A plan that does not move changes nothing."""
    indicator = indicator_on(two_lanes(), 1)
    x = np.linspace(0.0, 60.0, 11)
    indicator.update(plan(x, WIDTH * x / 60.0))
    stands = np.tile((36.0, 2.1, 0.05), (11, 1))
    indicator.update(stands)
    assert indicator.shown == Light.LEFT
    # Back in its own lane it has abandoned the change.
    indicator.update(plan(36.0 + x, np.zeros(11)))
    assert indicator.shown == 0


def test_a_change_that_was_never_made_is_over_on_another_lane() -> None:
    """The plan led to the left lane; the vehicle comes to the middle of the right lane."""
    indicator = indicator_on(made({
        1: Piece((0.0, 0.0, 0.0), 300.0, left=2, right=3),
        2: Piece((0.0, WIDTH, 0.0), 300.0, right=1),
        3: Piece((0.0, -WIDTH, 0.0), 300.0, left=1)}), 1)
    x = np.linspace(0.0, 60.0, 11)
    indicator.update(plan(x, WIDTH * x / 60.0))
    assert indicator.shown == Light.LEFT
    indicator.update(plan(x, -WIDTH - 0.8 + 0.8 * x / 60.0))
    assert indicator.shown == 0


@pytest.mark.parametrize(('x', 'expected'), [
    (75.0, 0), (82.0, Light.LEFT), (88.0, Light.LEFT), (96.0, Light.LEFT), (104.0, Light.LEFT)])
def test_a_vehicle_standing_before_a_fork_indicates_within_30_m(x: float, expected: int) -> None:
    """A lanelet of 10 m up to a stop line lies between."""
    before = Piece((0.0, 0.0, 0.0), 100.0, after=(2,))
    line = Piece(before.end, 10.0, after=(3, 4))
    indicator = indicator_on(made({1: before, 2: line, 3: Piece(line.end, 20.0, 90.0),
                                   4: Piece(line.end, 20.0)}), 3)
    indicator.update(np.tile((x, 0.0, 0.0), (11, 1)))
    assert indicator.shown == expected


def test_a_turn_behind_another_fork_is_not_shown_before_that() -> None:
    """As in a roundabout, where the exit before the vehicle's own is near."""
    before = Piece((0.0, 0.0, 0.0), 100.0, after=(2, 5))
    line = Piece(before.end, 10.0, after=(3, 4))
    third = Piece(line.end, 20.0, 90.0)
    indicator = indicator_on(made({
        1: before, 2: line, 3: third, 4: Piece(line.end, 20.0),
        5: Piece(before.end, 20.0, 90.0)}), 3)
    way = np.concatenate([piece.poses()[:-1] for piece in (before, line, third)])
    for x, expected in ((95, 0), (102, Light.LEFT)):
        # Both if it stands there and if it drives on.
        for poses in (np.tile(way[x], (11, 1)), way[x:x + 22:2]):
            indicator.forget()
            indicator.update(poses)
            assert indicator.shown == expected


def test_a_vehicle_on_the_only_way_does_not_turn_off() -> None:
    """Others enter lanelet 3, which bends, from 2, from which straight on is possible."""
    first = Piece((0.0, 0.0, 0.0), 50.0, after=(3,))
    second = Piece((20.0, 30.0, -90.0), 30.0, after=(3, 4))
    third = Piece(first.end, 30.0, 90.0)
    roads = made({1: first, 2: second, 3: third, 4: Piece(second.end, 30.0)})
    indicator = indicator_on(roads, 3)
    way = np.concatenate((first.poses(), third.poses()[1:]))
    # Also once it is on it.
    for at in range(20, 70, 5):
        indicator.update(way[at:at + 20:2])
        assert indicator.shown == 0, at


def test_overtaking_on_the_lane_of_oncomers_is_shown() -> None:
    """To the left and back to the right, over lanelets of which only the first is beside."""
    roads = made({1: Piece((0.0, 0.0, 0.0), 150.0, after=(2,), opposite=4),
                  2: Piece((150.0, 0.0, 0.0), 150.0, opposite=3),
                  3: Piece((300.0, WIDTH, 180.0), 150.0, after=(4,), opposite=2),
                  4: Piece((150.0, WIDTH, 180.0), 150.0, opposite=1)})
    indicator = indicator_on(roads, 2)
    x = np.arange(0.0, 300.0, 5.0)
    y = WIDTH * 0.5 * (np.cos(np.pi * np.clip((x - 170.0) / 40.0, 0.0, 1.0))
                       - np.cos(np.pi * np.clip((x - 60.0) / 40.0, 0.0, 1.0)))
    way, shown = plan(x, y), {}
    for first in range(len(way) - 10):
        indicator.update(way[first:first + 11])
        shown[int(x[first])] = indicator.shown
    assert shown[0] == 0 and {shown[at] for at in range(40, 90, 5)} == {Light.LEFT}
    # On the other lane, until the plan leads back.
    assert {shown[at] for at in range(105, 135, 5)} == {0}
    assert {shown[at] for at in range(150, 200, 5)} == {Light.RIGHT}
    assert {shown[at] for at in range(210, 250, 5)} == {0}
