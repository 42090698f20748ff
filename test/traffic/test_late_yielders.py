# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Drivers that see late that they have to yield: they brake hard, and still yield."""

from pathlib import Path
from typing import Any

from crgame_ros.game.game import Game
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.traffic.crossing.meetings import CrossingRules
import numpy as np
from numpy.typing import NDArray
import pytest
import traffic_support as support

LATE = CrossingRules().late
# The agents' deceleration for a line that they see in time [m/s^2].
IN_TIME = 1.6


def towards_a_human(maps: Path, share: float) -> support.Run:
    """Run an agent out of the side road at 12 m/s, and a human along the main road."""
    path = maps / 'ZAM_Intersection-1_1_T-1.xml'
    roads = RoadNetwork(load_scenario(path).scenario.lanelet_network)
    start = roads.pose_on(21, roads.line(21).length - 50.0)
    agent = support.driving(1, [start, roads.pose_on(42, 50.0)], 12.0)
    return support.Run(path, TrafficSpec(late_yielders=share), 0,
                       [support.human(-110.0, -1.75, 0.0, 13.0)], [agent]).ticks(110)


def braking(run: support.Run) -> NDArray[np.float64]:
    """Return the decelerations (ticks, A) [m/s^2]."""
    return -np.diff(run.speeds, axis=0) / run.dt


def test_braking_begins_as_late_as_hard_braking_allows(maps: Path) -> None:
    """From 12 m/s by v^2 / 2b: 45 m before the line with 1.6 m/s^2, and 16 m with 4.5 m/s^2."""
    in_time, late = (towards_a_human(maps, share) for share in (0.0, 1.0))
    assert in_time.overlaps() == late.overlaps() == []
    way = []
    for run in (in_time, late):
        poses, speeds = run.series(0)
        begin, end = int(np.argmax(speeds < 11.9)), int(np.nanargmin(speeds))
        way.append(float(np.hypot(*(poses[end, :2] - poses[begin, :2]))))
        # Both let the human go first, at the same line.
        assert speeds[end] < 1.5
    assert way[0] > 40.0
    assert way[1] == pytest.approx(12.0**2 / (2.0 * LATE), abs=1.5)
    assert braking(in_time).max() == pytest.approx(IN_TIME, abs=0.1)
    assert LATE - 0.5 < braking(late).max() < LATE
    apart = [min(run.outline(0, poses[0]).distance(support.rectangle(
        np.array(run.actors[0].at(k, run.dt)[0]), 4.5, 1.8))
        for k, poses in enumerate(run.poses)) for run in (in_time, late)]
    assert apart[1] < apart[0] - 1.5


@pytest.mark.exhaustive
def test_an_av_with_the_right_of_way_meets_them(shared_scenarios: Path) -> None:
    """
    A recorded car comes to a real junction which the AV crosses first, having the right of way.

    It yields to the AV in both cases. As a late yielder it brakes 2.7 times as hard and is
    0.9 m/s faster halfway. Without the AV it drives on.
    """
    def speeds(**given: Any) -> NDArray[np.float64]:
        spec = TrafficSpec(recorded='reactive', late_yielders=given.pop('share'))
        result = run_offline(build_setup(Game(
            shared_scenarios / 'DEU_Guetersloh-36_1_T-1.xml', humans=(), traffic=spec,
            **given)), duration_s=6.5)
        column = result.setup.obstacles.ids.index('o316')
        return np.asarray(np.hypot(*result.object_velocities[:, column, :2].T))

    in_time, late, alone = speeds(share=0.0), speeds(share=1.0), speeds(share=1.0, avs=())
    # It gets behind another car in the first 2 s.
    hardest = [float(-np.diff(speed[20:]).min() / 0.1) for speed in (in_time, late)]
    assert hardest[0] == pytest.approx(IN_TIME, abs=0.1)
    assert LATE - 0.5 < hardest[1] < LATE
    assert late[30] > in_time[30] + 0.8
    assert in_time[-1] < 0.1 and late[-1] < 0.1 and alone[-1] > 5.0


@pytest.mark.exhaustive
def test_a_late_yielder_alone_drives_like_any_other(shared_scenarios: Path) -> None:
    """Alone over the junctions of a real town, from the side of one: the same bits."""
    path = shared_scenarios / 'ZAM_Tjunction-1_42_T-1.xml'
    roads = RoadNetwork(load_scenario(path).scenario.lanelet_network)
    alone = support.driving(1, [roads.pose_on(50201, 5.0), roads.pose_on(50203, 20.0)], 8.0)
    runs = [support.Run(path, TrafficSpec(late_yielders=share), 0, (), [alone]).ticks(80)
            for share in (0.0, 1.0)]
    poses = [np.array(run.poses) for run in runs]
    assert poses[0].tobytes() == poses[1].tobytes()
    assert np.hypot(*(np.nanmax(poses[0], axis=0) - np.nanmin(poses[0], axis=0))[0, :2]) > 30.0


@pytest.mark.exhaustive
@pytest.mark.parametrize('name', ['more/DEU_TestIntersectionInteract-3_1_T-1',
                                  'more/DEU_AAH1-2_76900_T-7049'])
def test_in_dense_traffic_they_brake_hard_and_touch_no_vehicle(shared_scenarios: Path,
                                                               name: str) -> None:
    """At priority signs of real junctions; drivers that see them in time never brake so hard."""
    hard = []
    for share in (0.0, 1.0):
        spec = TrafficSpec(agents=20, flow=400.0, late_yielders=share)
        run = support.Run(shared_scenarios / f'{name}.xml', spec, 0).ticks(250)
        assert run.overlaps() == []
        hard.append(int((braking(run) > 4.0).sum()))
    assert hard[0] == 0
    assert hard[1] > 20
