# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs of games and scenarios whose maps are turned or moved, compared with those that are not."""

import math
from pathlib import Path
from typing import Any

from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.common.file_writer import CommonRoadFileWriter, OverwriteExistingFile
from commonroad.planning.planning_problem import PlanningProblemSet
from commonroad.scenario.scenario import Scenario
from crgame_ros.game.file import parse_game
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray
import yaml

# Zone 32 of UTM, near Munich [m].
UTM = (691_000.0, 5_336_000.0)
DIGITS = 14
# A scenario without a game: one AV, and agents that take the place of its recorded vehicles.
PLAYED = {'humans': [], 'avs': [{'id': 'av0', 'planner': 'idm'}], 'seed': 1,
          'traffic': {'recorded': 'reactive', 'agents': 10}}


def played_values(path: Path) -> dict[str, Any]:
    """Return the values of a game's file, or of `PLAYED` in a CommonRoad scenario."""
    return {**PLAYED, 'scenario': path.name} if path.suffix == '.xml' \
        else dict(yaml.safe_load(path.read_text()))


def write_exactly(scenario: Scenario, problems: PlanningProblemSet, path: Path) -> str:
    """Write a scenario with all digits of its coordinates; return the path as text."""
    CommonRoadFileWriter(scenario, problems, decimal_precision=DIGITS).write_to_file(
        str(path), OverwriteExistingFile.ALWAYS)
    return str(path)


def placed(values: Any, angle: float, offset: tuple[float, float]) -> Any:
    """Return the values of a game's file with the coordinates of its map placed anew."""
    cos, sin = math.cos(angle), math.sin(angle)

    def point(x: float, y: float) -> list[float]:
        return [cos * x - sin * y + offset[0], sin * x + cos * y + offset[1]]
    if isinstance(values, list):
        return [placed(each, angle, offset) for each in values]
    if not isinstance(values, dict):
        return values
    found = {}
    for key, value in values.items():
        if key == 'at' and isinstance(value, list):
            found[key] = [*point(*value[:2]), *(yaw + angle for yaw in value[2:])]
        elif key == 'path' and isinstance(value, list):
            found[key] = [point(*place) for place in value]
        else:
            found[key] = placed(value, angle, offset)
    if {'x', 'y'} <= values.keys():
        found['x'], found['y'] = point(values['x'], values['y'])
        found['yaw'] = values.get('yaw', 0.0) + angle
    return found


def run_placed(path: Path, folder: Path, angle: float, offset: tuple[float, float],
               duration_s: float) -> OfflineResult:
    """
    Run a game whose map is turned by an angle [rad] around the origin, then moved.

    :param path: of a game, or of a CommonRoad scenario, which is then `PLAYED`.
    """
    played = played_values(path)
    game = parse_game(played, str(path), path.parent)
    scenario, problems = CommonRoadFileReader(str(game.scenario)).open()
    for each in (scenario, problems):
        each.translate_rotate(np.zeros(2), angle)
        each.translate_rotate(np.array(offset), 0.0)
    values = placed(played, angle, offset)
    values['scenario'] = write_exactly(
        scenario, problems,
        folder / f'{path.stem}_{round(math.degrees(angle))}_{round(offset[0])}.xml')
    return run_offline(build_setup(parse_game(values, str(path), path.parent)),
                       duration_s=duration_s)


def difference(one: OfflineResult, other: OfflineResult, angle: float,
               offset: tuple[float, float]) -> tuple[float, float, float]:
    """Return the largest differences of positions [m], yaws [rad] and speeds [m/s]."""
    cos, sin = math.cos(angle), math.sin(angle)
    back = np.array(((cos, -sin), (sin, cos)))

    def undone(states: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray((states[..., :2] - offset) @ back)
    first, second = one.vehicle_states, other.vehicle_states
    steps = min(len(first), len(second))
    first, second = first[:steps], second[:steps]
    yaws = second[..., StateColumn.YAW] - angle - first[..., StateColumn.YAW]
    return (float(np.abs(undone(second) - first[..., :2]).max()),
            float(np.abs((yaws + np.pi) % (2.0 * np.pi) - np.pi).max()),
            float(np.abs(second[..., StateColumn.SPEED] - first[..., StateColumn.SPEED]).max()))
