# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs of games and scenarios whose maps are mirrored, turned or moved, compared with others."""

import math
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

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
_SIDES = {'left': 'right', 'right': 'left', 'leftBound': 'rightBound', 'rightBound': 'leftBound',
          'adjacentLeft': 'adjacentRight', 'adjacentRight': 'adjacentLeft',
          'successorsLeft': 'successorsRight', 'successorsRight': 'successorsLeft'}
_LATERAL = ('y', 'orientation', 'yawRate', 'steeringAngle', 'slipAngle', 'velocityY')


class Placement(NamedTuple):
    """
    A place of a map: first mirrored, then turned around the origin, then moved.

    :param degrees: counter-clockwise.
    :param offset: x and y [m].
    :param mirrored: along the x axis: left and right are exchanged.
    """

    degrees: float = 0.0
    offset: tuple[float, float] = (0.0, 0.0)
    mirrored: bool = False

    @property
    def _side(self) -> float:
        return -1.0 if self.mirrored else 1.0

    @property
    def _turned(self) -> NDArray[np.float64]:
        angle = math.radians(self.degrees)
        return np.array(((math.cos(angle), -math.sin(angle)),
                         (math.sin(angle), math.cos(angle)))) * (1.0, self._side)

    @property
    def name(self) -> str:
        """Return a name for people."""
        return 'mirrored' if self.mirrored else 'UTM' if any(self.offset) else f'{self.degrees:g}°'

    def point(self, x: float, y: float) -> list[float]:
        """Return where a point of the map comes to lie."""
        placed: list[float] = (self._turned @ (x, y) + self.offset).tolist()
        return placed

    def yaw(self, yaw: float) -> float:
        """Return where a direction of the map comes to point."""
        return self._side * yaw + math.radians(self.degrees)

    def undone(self, states: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return x, y, yaw and speed (..., 4) of states (..., 8) in the map as it was."""
        positions = (states[..., :2] - self.offset) @ self._turned
        yaws = self._side * (states[..., StateColumn.YAW] - math.radians(self.degrees))
        return np.concatenate((positions, yaws[..., None],
                               states[..., StateColumn.SPEED, None]), axis=-1)


def played_values(path: Path) -> dict[str, Any]:
    """Return the values of a game's file, or of `PLAYED` in a CommonRoad scenario."""
    return {**PLAYED, 'scenario': path.name} if path.suffix == '.xml' \
        else dict(yaml.safe_load(path.read_text()))


def write_exactly(scenario: Scenario, problems: PlanningProblemSet, path: Path) -> str:
    """Write a scenario with all digits of its coordinates; return the path as text."""
    CommonRoadFileWriter(scenario, problems, decimal_precision=DIGITS).write_to_file(
        str(path), OverwriteExistingFile.ALWAYS)
    return str(path)


def placed(values: Any, place: Placement) -> Any:
    """Return the values of a game's file with the coordinates of its map placed anew."""
    if isinstance(values, list):
        return [placed(each, place) for each in values]
    if not isinstance(values, dict):
        return values
    found = {}
    for key, value in values.items():
        if key == 'at' and isinstance(value, list):
            found[key] = [*place.point(*value[:2]), *map(place.yaw, value[2:])]
        elif key == 'path' and isinstance(value, list):
            found[key] = [place.point(*each) for each in value]
        elif key == 'd' and place.mirrored:
            found[key] = -value
        else:
            found[key] = placed(value, place)
    if {'x', 'y'} <= values.keys():
        found['x'], found['y'] = place.point(values['x'], values['y'])
        found['yaw'] = place.yaw(values.get('yaw', 0.0))
    return found


def run_placed(path: Path, folder: Path, place: Placement, duration_s: float) -> OfflineResult:
    """
    Run a game whose map is placed anew.

    :param path: of a game, or of a CommonRoad scenario, which is then `PLAYED`.
    :param folder: for the files of this placement alone.
    """
    folder.mkdir(exist_ok=True)
    played = played_values(path)
    source = path.parent / played['scenario']
    if place.mirrored:
        source = _mirrored_scenario(source, folder / 'mirrored.xml')
    scenario, problems = CommonRoadFileReader(str(source)).open()
    for each in (scenario, problems):
        each.translate_rotate(np.zeros(2), math.radians(place.degrees))
        each.translate_rotate(np.array(place.offset), 0.0)
    values = placed(played, place)
    values['scenario'] = write_exactly(scenario, problems, folder / f'{path.stem}.xml')
    if place.mirrored:
        for human in values['humans']:
            human['driver'] = _mirrored_driver(human['driver'], path.parent, folder)
    return run_offline(build_setup(parse_game(values, str(path), path.parent)),
                       duration_s=duration_s)


def _mirrored_scenario(path: Path, to: Path) -> Path:
    """Write a CommonRoad file with left and right exchanged, and return its path."""
    tree = ElementTree.parse(path)
    for element in tree.iter():
        element.tag = _SIDES.get(element.tag, element.tag)
        if element.tag in _LATERAL:
            for value in (element, *element):
                if value.text and value.text.strip():
                    value.text = repr(-float(value.text))
            ends = {each.tag: each for each in element}
            if 'intervalStart' in ends:
                ends['intervalStart'].tag, ends['intervalEnd'].tag = 'intervalEnd', 'intervalStart'
    tree.write(to, encoding='utf-8', xml_declaration=True)
    return to


def _mirrored_driver(driver: str, base: Path, folder: Path) -> str:
    """Write a driver's timeline with left and right exchanged, and return the driver."""
    kind, _, name = driver.partition(':')
    values = yaml.safe_load((base / name).read_text())
    for held in values.get('keys', ()):
        held['hold'] = [_SIDES.get(key, key) for key in held['hold']]
    if 'joy' in values:
        column = 1 + values['joy']['axes'].index('steering')
        for point in values['joy']['points']:
            point[column] = -point[column]
    mirrored = folder / Path(name).name
    mirrored.write_text(yaml.safe_dump(values))
    return f'{kind}:{mirrored}'


def difference(one: OfflineResult, other: OfflineResult,
               place: Placement) -> tuple[float, float, float]:
    """
    Return the largest differences of positions [m], yaws [rad] and speeds [m/s].

    :param one: a run in the map as it is.
    :param other: the run in the map placed anew.
    """
    first, second = Placement().undone(one.vehicle_states), place.undone(other.vehicle_states)
    steps = min(len(first), len(second))
    apart = second[:steps] - first[:steps]
    apart[..., 2] = (apart[..., 2] + np.pi) % (2.0 * np.pi) - np.pi
    largest = np.abs(apart).max(axis=tuple(range(apart.ndim - 1)))
    return float(largest[:2].max()), float(largest[2]), float(largest[3])
