# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Completes a scenario of recorded traffic: a planning problem, and a header that names it."""

from dataclasses import dataclass

from commonroad.scenario.obstacle import DynamicObstacle
from commonroad.scenario.scenario import ScenarioID, Tag
from crgame_ros.errors import one_line
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.route import find_route
from crgame_ros.scenario import guard
from crgame_ros.scenario.exact_values import exact_value
from crgame_ros.scenario.export_document import scenario_document, scenario_header
from crgame_ros.scenario.export_elements import (
    dynamic_obstacle,
    DYNAMIC_TYPES,
    goal_state,
    placed_rectangle,
    planning_problem,
    whole,
)
from crgame_ros.scenario.export_ids import IdPool
from crgame_ros.scenario.export_network import used_ids, write_roads
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.vehicle.lights import Light
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# An AV takes the place of a car that goes so far from where it was at first [m].
_LEAST_WAY = 5.0
# Its yaw rate at first is the mean over so long [s]: positions are rounded.
_TURNING_S = 0.4
# Around the footprint where the car ended [m], along and across.
_MARGIN = (10.0, 2.0)
_SHORTEST = 10


@dataclass(frozen=True)
class RecordedScenario:
    """
    A scenario of recorded traffic.

    :param benchmark_id: its benchmark id.
    :param xml_text: the content of the file; it is valid by CommonRoad's schema but for vehicles
        that appear after time step 0.
    """

    benchmark_id: str
    xml_text: str


def recorded_scenario(loaded: LoadedScenario, number: int,
                      source: str) -> RecordedScenario | None:
    """
    Return a scenario in which an AV takes the place of a recorded car.

    It is the car that goes farthest of those that are there at time step 0, on lanes for cars at
    the beginning and the end, with a route between. Its goal is where it ended.

    :param loaded: what the converter wrote, with obstacles from time step 0 on.
    :param number: of the scenario among those of its data set, from 1 on.
    :param source: what it is of, for its header.
    :return: None if there is no such car, or the scenario is shorter than 10 time steps.
    """
    network = RoadNetwork(loaded.scenario.lanelet_network)
    recorded = ScenarioObstacles(loaded)
    ego = _find_ego(network, recorded)
    if ego is None:
        return None
    notes: list[str] = []
    roads = write_roads(loaded, 0, notes)
    for tags in roads.elements:
        simulated = tags.find('simulated') if tags.tag == 'scenarioTags' else None
        if simulated is not None and Tag.SIMULATED not in (loaded.scenario.tags or ()):
            tags.remove(simulated)
    ids = IdPool(used_ids(roads.elements), notes)
    obstacles = {f'o{each.obstacle_id}': each for each in loaded.scenario.dynamic_obstacles}
    written = [_obstacle(recorded, column, obstacles[name], ids)
               for column, name in enumerate(recorded.ids)
               if name in obstacles and column != ego[0]]
    problem = _problem(recorded, *ego, obstacles[recorded.ids[ego[0]]], ids.fresh())
    given: ScenarioID = loaded.scenario.scenario_id
    benchmark_id = str(ScenarioID(False, given.country_id, given.map_name, given.map_id, number,
                                  'T', 1))
    root = guard.parse_hardened(loaded.xml_text, loaded.source)
    header = scenario_header(benchmark_id, loaded.time_step_s, one_line(source),
                             author=root.get('author', ''),
                             affiliation=root.get('affiliation', ''))
    return RecordedScenario(benchmark_id, scenario_document(
        header, roads.elements, ''.join(written) + problem, late=True))


def _find_ego(network: RoadNetwork, recorded: ScenarioObstacles) -> tuple[int, int] | None:
    """Return the column of the car whose place an AV takes, and its last time step on a lane."""
    poses = recorded.poses
    if recorded.first_k or len(poses) < _SHORTEST:
        return None
    ways = np.nanmax(np.hypot(*np.moveaxis(poses - poses[0], -1, 0)[:2]), axis=0,
                     initial=0.0, where=np.isfinite(poses[:, :, 0]) & np.isfinite(poses[0, :, 0]))
    cars = [column for column, item in enumerate(recorded.descriptions)
            if item.type == 'car' and ways[column] >= _LEAST_WAY]
    for column in sorted(cars, key=lambda each: (-ways[each], each)):
        there = np.flatnonzero(np.isfinite(poses[:, column, 0]))
        lanes = [network.lanelet_ids[place] if place >= 0 else None
                 for place in network.lanelets_at(poses[there, column]).tolist()]
        on = [k for k, lane in zip(there.tolist(), lanes, strict=True)
              if lane is not None and network.is_drivable(lane)]
        first, last = lanes[0], on[-1] if on else 0
        goal = lanes[int(np.searchsorted(there, last))]
        if not on or on[0] != 0 or first is None or goal is None or last < _SHORTEST - 1:
            continue
        s, _ = network.locate(first, *poses[0, column, :2])
        if find_route(network, first, s, frozenset({goal}), 0.0).goal is not None:
            return column, last
    return None


def _obstacle(recorded: ScenarioObstacles, column: int, obstacle: DynamicObstacle,
              ids: IdPool) -> str:
    item = recorded.descriptions[column]
    there = np.flatnonzero(np.isfinite(recorded.poses[:, column, 0]))
    first = recorded.first_k + int(there[0])
    rows = np.column_stack((recorded.poses[there, column], _speeds(obstacle, there)))
    signals = recorded.signals.get(column)
    # Those that the converter infers from turns.
    shown = [] if signals is None else [
        (False, bool(bits & Light.LEFT), bool(bits & Light.RIGHT))
        for bits in map(signals.at, range(first, first + len(there)))]
    kind = item.type if item.type in DYNAMIC_TYPES else 'unknown'
    return dynamic_obstacle(ids.keep(obstacle.obstacle_id, item.id), kind, whole(item.shape),
                            rows.tolist(), False, shown, first)


def _speeds(obstacle: DynamicObstacle, steps: NDArray[np.int_]) -> FloatArray:
    """Return the recorded speeds at time steps [m/s]."""
    states = [obstacle.initial_state, *obstacle.prediction.trajectory.state_list]
    return np.interp(steps, [each.time_step for each in states],
                     [exact_value(each.velocity) for each in states])


def _problem(recorded: ScenarioObstacles, column: int, last: int, obstacle: DynamicObstacle,
             number: int) -> str:
    poses, shape = recorded.poses[:, column], recorded.descriptions[column].shape
    turning = recorded.velocities[:max(1, round(_TURNING_S / recorded.time_step_s)), column, 2]
    row = (*poses[0].tolist(), exact_value(obstacle.initial_state.velocity),
           exact_value(getattr(obstacle.initial_state, 'acceleration', None)),
           float(turning.mean()))
    goal = placed_rectangle(shape.length + _MARGIN[0], shape.width + _MARGIN[1],
                            poses[last].tolist())
    return planning_problem(number, row, [goal_state((0, len(poses) - 1), goal)])
