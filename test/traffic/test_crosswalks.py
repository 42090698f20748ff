# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Agents at crossings for pedestrians."""

from commonroad.common.common_lanelet import LaneletType
from commonroad.scenario.scenario import Scenario
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.geometry.shape import Shape
import numpy as np
import pytest
from traffic_support import Actor, driving, human, lane_strip, roads, Run, straight_lane

PERSON = Shape.rectangle(0.5, 0.5)
# The crossing begins at this x [m].
BEGIN = 98.0


def street() -> Scenario:
    """Make a road of two lanes to the east and a crossing of 4 m over it, around x = 100 m."""
    return roads(
        straight_lane(1, 0.0, 0.0, 300.0, adjacent_left=2, adjacent_left_same_direction=True),
        straight_lane(2, 3.5, 0.0, 300.0, adjacent_right=1, adjacent_right_same_direction=True),
        lane_strip(3, [(100.0, y) for y in np.linspace(-1.75, 5.25, 10)], 4.0,
                   lanelet_type={LaneletType.CROSSWALK}))


def person(y: float, speed: float = 0.0, since: int = 0, until: int = 10**9) -> Actor:
    """Make a person in the middle of the crossing who walks to the left."""
    return human(100.0, y, 0.5 * np.pi, speed, since, until, 'pedestrian', PERSON)


def drive(walker: Actor, start: float, ticks: int) -> tuple[np.ndarray, np.ndarray]:
    """Return where the front of a car in the right lane is, at 13 m/s from a start, its speed."""
    car = driving(1, [(start, 0.0, 0.0), (290.0, 0.0, 0.0)], 13.0)
    run = Run(street(), TrafficSpec(), 0, [walker], [car]).ticks(ticks)
    assert run.overlaps() == []
    poses, speeds = run.series(0)
    return poses[:, 0] + 2.25, speeds


def test_an_agent_waits_for_a_person_who_stands_on_the_next_lane_of_the_crossing() -> None:
    """The person stands there for 10 s, too short to stand for good, and walks on."""
    front, speed = drive(person(4.5, until=99), 45.0, 160)
    assert speed[90:99].max() < 0.5 and BEGIN - 2.0 < front[99] < BEGIN
    assert np.diff(speed).min() / 0.1 > -3.0
    assert front[-1] > BEGIN + 15.0


def test_an_agent_goes_on_as_soon_as_the_person_has_left_its_lane() -> None:
    """From x = 2.25 m on, half a metre beyond the lane's edge, the person only walks away."""
    front, speed = drive(person(-1.5, 1.0), 55.0, 60)
    slowest = int(np.argmin(speed))
    assert 3.6 < 0.1 * slowest < 4.2
    assert speed[slowest] < 8.0 and front[slowest] < BEGIN
    # The person is still on the crossing.
    assert -1.5 + 0.1 * 60 < 5.25


@pytest.mark.parametrize('what', ['for good', 'too late'])
def test_an_agent_does_not_wait(what: str) -> None:
    """Neither for who stands there for good, nor where it would have to brake hard for it."""
    if what == 'for good':
        front, speed = drive(person(4.5), 55.0, 180)
        assert speed[:100].min() < 0.5
    else:
        # 13 m/s take 28 m at 3 m/s^2; the person appears 18 m ahead.
        front, speed = drive(person(4.5, since=1), 78.0, 40)
        assert speed.min() > 12.0
    assert front[-1] > BEGIN + 15.0
