# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Indicators of AVs: on made plans, on published maps, and in runs."""

from pathlib import Path

from commonroad.common.file_reader import CommonRoadFileReader
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.export import write_scenario
from crgame_ros.recording.run_trajectories import trajectories_of
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.turns import Turns
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.plan_indicator import PlanIndicator
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.lights import Light
import numpy as np
from numpy.typing import NDArray
import pytest


def read(path: Path) -> tuple[RoadNetwork, PlanIndicator]:
    """Read a map, and make an indicator for its first planning problem."""
    scenario, problems = CommonRoadFileReader(path).open()
    problem = next(iter(problems.planning_problem_dict.values()))
    roads = RoadNetwork(scenario.lanelet_network)
    state = problem.initial_state
    return roads, PlanIndicator(roads, Turns(roads), problem,
                                (*state.position.tolist(), state.orientation))


def own(name: str) -> tuple[RoadNetwork, PlanIndicator]:
    """Read one of the package's maps."""
    return read(scenarios_directory() / f'{name}.xml')


def planned(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Make poses of a plan from the points that it passes, 0.1 s apart."""
    step = np.gradient(points, axis=0)
    return np.column_stack((points, np.arctan2(step[:, 1], step[:, 0])))


def along(roads: RoadNetwork, before: int, way: int) -> NDArray[np.float64]:
    """Make a 5 s plan from 20 m before the end of a lanelet up to the end of the next one."""
    points = np.concatenate([from_end(roads.line(before).points, 20.0), roads.line(way).points])
    points = points[np.append(True, np.hypot(*np.diff(points, axis=0).T) > 1e-6)]
    s = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    at = np.linspace(0.0, s[-1], 51)
    return planned(np.column_stack([np.interp(at, s, column) for column in points.T]))


def from_end(points: NDArray[np.float64], length: float) -> NDArray[np.float64]:
    """Return the last metres of a line."""
    to_end = np.append(np.cumsum(np.hypot(*np.diff(points, axis=0).T)[::-1])[::-1], 0.0)
    at = np.linspace(min(length, to_end[0]), 0.0, 21)
    return np.column_stack([np.interp(-at, -to_end, column) for column in points.T])


@pytest.mark.parametrize('side', [Light.LEFT, Light.RIGHT])
def test_lane_change_is_shown_up_to_the_middle_of_the_new_lane(side: Light) -> None:
    """A plan of 5 s to the lane beside, then plans from ever later points of the same path."""
    roads, indicator = own('ZAM_Traffic-1_1_T-1')
    beside_of = RoadNetwork.left_of if side is Light.LEFT else RoadNetwork.right_of
    lane, beside = next((lane, beside) for lane in roads.lanelet_ids
                        if (beside := beside_of(roads, lane)) is not None)
    across = roads.locate(beside, *roads.pose_on(lane, 60.0)[:2])[1]
    s = np.arange(60.0, 260.0, 1.0)
    offset = -across * 0.5 * (1.0 - np.cos(np.pi * np.clip((s - 70.0) / 60.0, 0.0, 1.0)))
    way = planned(roads.line(lane).poses(s, offset)[:, :2])
    shown = []
    for start in range(0, 100, 5):
        indicator.update(way[start:start + 51:5])
        # How far it has come to the new lane's middle.
        aside = abs(roads.locate(beside, *way[start, :2])[1])
        shown.append((aside, indicator.shown))
    assert {bits for aside, bits in shown if 0.5 < aside < abs(across) - 0.01} == {side}
    assert shown[-1][1] == 0 and shown[-1][0] < 0.1
    # A plan that stays in a lane, but not in its middle, is no change.
    indicator.update(planned(roads.line(lane).poses(s[:51], np.sin(s[:51] / 4.0))[:, :2])[::5])
    assert indicator.shown == 0


def test_a_vehicle_leaving_a_roundabout_indicates_and_one_going_round_does_not() -> None:
    """Right-hand traffic: to the right, whichever way the exit bends."""
    roads, indicator = own('ZAM_Roundabout-1_1_T-1')
    ring = {lanelet for lanelet in roads.lanelet_ids if comes_round(roads, lanelet)}
    assert ring
    exits = [(before, out) for before in ring for out in roads.successors(before)
             if out not in ring]
    assert exits
    for before, out in exits:
        onward, = (lanelet for lanelet in roads.successors(before) if lanelet in ring)
        for way, expected in ((out, Light.RIGHT), (onward, 0)):
            indicator.forget()
            indicator.update(along(roads, before, way)[::5])
            assert indicator.shown == expected, (before, way)


def comes_round(roads: RoadNetwork, lanelet: int) -> bool:
    """Return whether a lanelet leads over others back to itself."""
    reached, left = {lanelet}, [lanelet]
    while left:
        for following in roads.successors(left.pop()):
            if following == lanelet:
                return True
            if following not in reached:
                reached.add(following)
                left.append(following)
    return False


@pytest.mark.exhaustive
def test_turns_are_those_that_published_maps_name(shared_scenarios: Path) -> None:
    """Intersections name the ways to the left, to the right, and straight on."""
    wrong, count = [], 0
    for path in sorted((*shared_scenarios.glob('*.xml'),
                        *(shared_scenarios / 'more').rglob('*.xml'))):
        if '<planningProblem' not in path.read_text():
            continue
        roads, indicator = read(path)
        for intersection in roads.lanelet_network.intersections:
            for incoming in intersection.incomings:
                for light, ways in ((Light.LEFT, incoming.successors_left),
                                    (Light.RIGHT, incoming.successors_right),
                                    (Light(0), incoming.successors_straight)):
                    for before, way in ((lane, way) for lane in incoming.incoming_lanelets
                                        for way in ways & {*roads.successors(lane)}):
                        bend = np.degrees(np.ptp(roads.line(way).heading[[0, -1]]))
                        # Some name a bend of 90 degrees straight on, or a straight way left.
                        if bend > 45.0 if light else bend < 15.0:
                            indicator.forget()
                            indicator.update(along(roads, before, way)[::5])
                            count += 1
                            if indicator.shown != light:
                                wrong.append((path.stem, before, way, light, indicator.shown))
    assert count > 20
    assert not wrong, (count, wrong)


@pytest.mark.slow
def test_run_shows_records_and_exports_it(tmp_path: Path) -> None:
    """The AV leaves the roundabout at the end of its game: the indicator gets into the file."""
    result = drive('roundabout', 20.0)
    assert np.isnan(result.commands[:, 1, [0, 1, 2, 3, 5]]).all()
    lights = np.nan_to_num(result.commands[:, 1, 4])
    turned = np.flatnonzero(lights)
    # Once, and until the end.
    assert set(lights) == {0.0, 2.0} and np.ptp(turned) == len(turned) - 1
    write_scenario(trajectories_of(result), tmp_path / 'run.xml')
    scenario, _ = CommonRoadFileReader(tmp_path / 'run.xml').open()
    series = [obstacle.signal_series for obstacle in scenario.dynamic_obstacles
              if obstacle.signal_series and any(
                  state.indicator_right for state in obstacle.signal_series)]
    ticks = np.flatnonzero(lights[::10])
    assert [[state.time_step for state in each if state.indicator_right]
            for each in series] == [ticks.tolist()]


def drive(name: str, duration_s: float) -> OfflineResult:
    """Drive one of the package's games."""
    return run_offline(build_setup(load_game(scenarios_directory() / f'{name}.yaml')),
                       duration_s=duration_s)
