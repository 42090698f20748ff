# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Traffic as a whole: agents see the human and react, and the same calls give the same bits."""

from pathlib import Path

from commonroad.scenario.scenario import Scenario
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.geometry.shape import Shape
from crgame_ros.roads.speed_limits import set_speed_limit
from crgame_ros.traffic.fleet.adoption import Adopted
from crgame_ros.traffic.following.car_following import CarFollowing
import numpy as np
import pytest
import traffic_support as support

MERGE, CROSSING = 'ZAM_Merge-1_1_T-1.xml', 'ZAM_Intersection-1_1_T-1.xml'


class FreeDriving(CarFollowing):
    """A model without car following: it drives as if no vehicle were ahead."""

    name = 'free'

    def __init__(self) -> None:
        super().__init__(2.0, 1.5, 8.0)

    def follow(self, speed: np.ndarray, desired_speed: np.ndarray, gap: np.ndarray,
               lead_speed: np.ndarray) -> np.ndarray:
        return 0.5 * (desired_speed - speed)

    def acceleration(self, speed: np.ndarray, desired_speed: np.ndarray, gap: np.ndarray,
                     *_: object) -> np.ndarray:
        return np.clip(self.follow(speed, desired_speed, gap, speed), -8.0, 1.5)

    def desired_gap(self, speed: np.ndarray) -> np.ndarray:
        return 2.0 + 1.5 * speed


class SameGap(FreeDriving):
    """A model whose gap is one number for all agents."""

    def desired_gap(self, speed: np.ndarray) -> float:
        return 5.0


class SameGaps(FreeDriving):
    """The same, with an entry for each agent."""

    def desired_gap(self, speed: np.ndarray) -> np.ndarray:
        return np.full_like(speed, 5.0)


def test_a_law_may_have_one_gap_for_all(maps: Path) -> None:
    one, each = (support.Run(maps / MERGE, TrafficSpec(
        agents=25, flow=500.0, model=f'{__file__}:{name}'), 0).ticks(100)
        for name in ('SameGap', 'SameGaps'))
    assert [poses.tobytes() for poses in one.poses] == [poses.tobytes() for poses in each.poses]


def test_without_car_following_they_do_hit(maps: Path) -> None:
    spec = TrafficSpec(agents=25, flow=500.0, model=f'{__file__}:FreeDriving')
    run = support.Run(maps / CROSSING, spec, 0).ticks(200)
    assert run.overlaps()


def test_idm_is_an_option(maps: Path) -> None:
    acc, idm = (support.Run(maps / MERGE, TrafficSpec(agents=20, model=model), 3).ticks(200)
                for model in ('acc', 'idm'))
    assert idm.overlaps() == []
    assert not np.array_equal(acc.poses[-1], idm.poses[-1])


def test_the_same_calls_give_the_same_bits(maps: Path) -> None:
    spec = TrafficSpec(agents=20, flow=600.0)
    first, again = (support.Run(maps / CROSSING, spec, 4).ticks(150) for _ in range(2))
    for left, right in zip(first.poses, again.poses, strict=True):
        assert left.tobytes() == right.tobytes()


def one_lane() -> Scenario:
    return support.roads(support.straight_lane(1, 0.0, 0.0, 1000.0))


def follower(x: float, speed: float) -> list[Adopted]:
    made = support.driving(1, [(x, 0.0, 0.0), (900.0, 0.0, 0.0)], speed)
    made.velocities[-1, 0] = 13.9
    return [made]


def test_an_agent_stops_behind_a_standing_human() -> None:
    human = support.human(200.0, 0.0, 0.0)
    run = support.Run(one_lane(), TrafficSpec(), 0, [human], follower(20.0, 13.0)).ticks(400)
    poses, speeds = run.series(0)
    assert speeds[-1] == 0.0
    # Behind the human's bumper with the standstill gap of 2 m, plus a rest that it does not creep.
    gap = 200.0 - 2.25 - (poses[-1, 0] + 2.25)
    assert 1.5 < gap < 2.6
    assert np.diff(speeds).min() > -0.4


def test_an_agent_follows_a_human_at_the_constant_time_gap() -> None:
    human = support.human(80.0, 0.0, 0.0, 10.0)
    run = support.Run(one_lane(), TrafficSpec(), 0, [human], follower(20.0, 10.0)).ticks(500)
    poses, speeds = run.series(0)
    ahead = human.at(500, 0.1)[0][0]
    assert speeds[-1] == pytest.approx(10.0, abs=0.05)
    # FS 3 between bumpers: s0 + T v = 2 + 1.3 * 10.
    assert ahead - poses[-1, 0] - 4.5 == pytest.approx(15.0, abs=0.5)


def test_an_agent_brakes_for_a_human_that_cuts_in() -> None:
    human = support.human(60.0, 0.0, 0.0, 8.0, since=20)
    run = support.Run(one_lane(), TrafficSpec(), 0, [human], follower(15.0, 13.0)).ticks(120)
    assert run.overlaps() == []
    _, speeds = run.series(0)
    assert speeds[20] > 12.5 and speeds[60] < 10.0


def test_an_agent_stops_for_a_pedestrian_that_walks_into_its_lane(maps: Path) -> None:
    walker = support.human(100.0, -4.5, 0.5 * np.pi, 1.4, since=20, kind='pedestrian',
                           shape=Shape.circle(0.35))
    run = support.Run(one_lane(), TrafficSpec(), 0, [walker], follower(45.0, 13.0)).ticks(160)
    poses, speeds = run.series(0)
    assert run.overlaps() == []
    # It brakes before the pedestrian is in the lane, which is 2 s after the first step.
    assert speeds[35] < 12.0
    assert poses[-1, 0] > 110.0, 'it goes on when the pedestrian has left'


def test_a_pedestrian_beside_the_road_stops_no_agent() -> None:
    walker = support.human(100.0, -4.0, 0.0, 1.4, kind='pedestrian', shape=Shape.circle(0.35))
    run = support.Run(one_lane(), TrafficSpec(), 0, [walker], follower(20.0, 13.0)).ticks(100)
    assert run.series(0)[1].min() > 12.0


def test_a_lower_speed_limit_is_obeyed() -> None:
    lane = support.straight_lane(1, 0.0, 0.0, 1000.0)
    scenario = support.roads(lane)
    run = support.Run(scenario, TrafficSpec(), 0, (), follower(20.0, 13.0)).ticks(50)
    set_speed_limit(scenario, 6.0)
    run.traffic.read_speed_limits(scenario.lanelet_network)
    run.ticks(150)
    factor = run.series(0)[1][45] / 13.9
    assert run.series(0)[1][-1] == pytest.approx(6.0 * factor, rel=0.05)
