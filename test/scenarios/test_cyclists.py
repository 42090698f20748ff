# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cyclists that cross, ride ahead slowly, or are oncoming: the AV runs into none."""

import math
from pathlib import Path

from commonroad.common.file_writer import CommonRoadFileWriter, OverwriteExistingFile
from commonroad.common.util import Interval
from commonroad.geometry.shape import Rectangle
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem, PlanningProblemSet
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario, ScenarioID
from commonroad.scenario.state import CustomState, InitialState, KSState
from commonroad.scenario.trajectory import Trajectory
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_game, with_planners
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np
import pytest

DT, TICKS = 0.1, 60
WIDTH = 3.5
BIKE = (1.8, 0.6)
# Up to this speed at a contact the slower one of the two has done all it could [m/s].
STOPPED = 0.3


def lane(number: int, y: float, back: bool) -> Lanelet:
    """Make a lane along x, or against it."""
    x = np.linspace(-60.0, 300.0, 37)[::-1 if back else 1]
    side = -0.5 * WIDTH if back else 0.5 * WIDTH
    line = np.column_stack((x, np.full_like(x, y)))
    other = {'adjacent_left': 3 - number, 'adjacent_left_same_direction': False}
    return Lanelet(line + (0.0, side), line, line - (0.0, side), number, **other)


def write(path: Path, speed: float, start: tuple[float, float], yaw: float,
          ride: float) -> Path:
    """Write a scenario of one AV at x = 0 and one cyclist that keeps speed and heading."""
    scenario = Scenario(DT, ScenarioID.from_benchmark_id('ZAM_Cyclist-1_1_T-1', '2020a'))
    scenario.add_objects([lane(1, 0.0, False), lane(2, WIDTH, True)])
    way = ride * DT * np.arange(TICKS + 1)
    points = np.column_stack((start[0] + way * math.cos(yaw), start[1] + way * math.sin(yaw)))
    shape = Rectangle(*BIKE)
    first = InitialState(time_step=0, position=points[0], orientation=yaw, velocity=ride,
                         acceleration=0.0, yaw_rate=0.0, slip_angle=0.0)
    states = [KSState(time_step=k, position=points[k], orientation=yaw, velocity=ride,
                      steering_angle=0.0) for k in range(1, TICKS + 1)]
    scenario.add_objects(DynamicObstacle(50, ObstacleType.BICYCLE, shape, first,
                                         TrajectoryPrediction(Trajectory(1, states), shape)))
    begin = InitialState(time_step=0, position=np.zeros(2), orientation=0.0, velocity=speed,
                         acceleration=0.0, yaw_rate=0.0, slip_angle=0.0)
    goal = GoalRegion([CustomState(time_step=Interval(TICKS, TICKS))])
    CommonRoadFileWriter(scenario, PlanningProblemSet([PlanningProblem(60, begin, goal)]),
                         'a', 'b', 'c', set()).write_to_file(
                             str(path), OverwriteExistingFile.ALWAYS)
    return path


def run_into(path: Path, planner: str) -> list[tuple[float, float]]:
    """Drive; list when and how fast the AV ran into the cyclist with its front [s], [m/s]."""
    game = effective_game(RunRequest(scenario=path, duration_s=DT * TICKS))
    setup = with_planners(build_setup(game), (planner,))
    result: OfflineResult = run_offline(setup)
    states = result.states_of('av0')
    hits = []
    for item in result.violations:
        if item.vehicle_id != 'av0' or 'o50' not in item.hit:
            continue
        cyclist = result.object_poses[item.n // 10, 0]
        x, y, yaw, speed = states[item.n, :4]
        ahead = (cyclist[0] - x) * math.cos(yaw) + (cyclist[1] - y) * math.sin(yaw)
        # A cyclist that rides into the AV's side or rear does not count.
        if speed > STOPPED and ahead > 1.4227 + 0.5 * 4.508 - 0.3:
            hits.append((0.01 * item.n, float(speed)))
    return hits


@pytest.mark.matrix('8.0-3.0-90')
@pytest.mark.slow
@pytest.mark.parametrize('angle', [90, -60, 40, 25, 140, -155])
@pytest.mark.parametrize(('speed', 'ride'), [(8.0, 3.0), (14.0, 5.0)])
def test_idm_runs_into_no_crossing_cyclist(angle: int, speed: float, ride: float,
                                           tmp_path: Path) -> None:
    """They reach the middle of the lane 25 m ahead before, with, and after the AV."""
    yaw = math.radians(angle)
    for late in (-0.5, 0.2, 0.8):
        time = 25.0 / speed + late
        start = 25.0 - time * ride * math.cos(yaw), -time * ride * math.sin(yaw)
        path = write(tmp_path / f'{late}.xml', speed, start, yaw, ride)
        assert run_into(path, 'idm') == [], late


@pytest.mark.matrix('3.0-0.9')
@pytest.mark.slow
@pytest.mark.parametrize('offset', [0.0, 0.9, -1.3])
@pytest.mark.parametrize('ride', [0.0, 3.0, -4.0])
def test_idm_runs_into_no_cyclist_in_its_lane(offset: float, ride: float,
                                              tmp_path: Path) -> None:
    """Standing, slower and oncoming cyclists, in the middle and at either edge of the lane."""
    yaw = 0.0 if ride >= 0.0 else math.pi
    start = 40.0 if ride >= 0.0 else 70.0
    path = write(tmp_path / 'lane.xml', 12.0, (start, offset), yaw, abs(ride))
    assert run_into(path, 'idm') == []
