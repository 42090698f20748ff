# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Copies of a game that should give the same verdict: mirrored, turned, moved, renumbered.

A planner that knows only one place, one side of the road or certain ids fails in them.
"""

from dataclasses import replace
import math
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.common.file_writer import CommonRoadFileWriter, OverwriteExistingFile
from commonroad.planning.planning_problem import PlanningProblemSet
from commonroad.scenario.scenario import Scenario
from crgame_ros.driver.source import parse_source
from crgame_ros.errors import InputError
from crgame_ros.game.game import Game, load_game
from crgame_ros.schema.writing import write
from crgame_ros.yaml_text import read_yaml
import numpy as np
from numpy.typing import NDArray
import yaml

# Zone 32 of UTM, near Munich [m].
UTM = (691_000.0, 5_336_000.0)
# Of coordinates in files: a double has no more.
DIGITS = 14
_SIDES = {'left': 'right', 'right': 'left', 'leftBound': 'rightBound', 'rightBound': 'leftBound',
          'adjacentLeft': 'adjacentRight', 'adjacentRight': 'adjacentLeft',
          'successorsLeft': 'successorsRight', 'successorsRight': 'successorsLeft'}
# Of traffic lights.
_DIRECTIONS = {'left': 'right', 'right': 'left', 'leftStraight': 'straightRight',
               'straightRight': 'leftStraight'}
_LATERAL = ('y', 'orientation', 'yawRate', 'steeringAngle', 'slipAngle', 'velocityY')
# Keys of a game with an id of its scenario, and keys with several.
_ID, _IDS = ('lanelet', 'planning_problem', 'object'), ('lanelets',)


class Placement(NamedTuple):
    """
    A place of a map: first mirrored, then turned around the origin, then moved.

    :param degrees: counter-clockwise.
    :param offset: x and y [m].
    :param mirrored: along the x axis: left and right are exchanged.
    :param added: to each id of the scenario.
    """

    degrees: float = 0.0
    offset: tuple[float, float] = (0.0, 0.0)
    mirrored: bool = False
    added: int = 0

    @property
    def _side(self) -> float:
        return -1.0 if self.mirrored else 1.0

    @property
    def turned(self) -> NDArray[np.float64]:
        """Return the matrix (2, 2) that mirrors and turns a point."""
        angle = math.radians(self.degrees)
        return np.array(((math.cos(angle), -math.sin(angle)),
                         (math.sin(angle), math.cos(angle)))) * (1.0, self._side)

    @property
    def name(self) -> str:
        """Return a name for people."""
        return 'mirrored' if self.mirrored else 'renumbered' if self.added else \
            'moved' if any(self.offset) else f'turned-{self.degrees:g}'

    def point(self, x: float, y: float) -> list[float]:
        """Return where a point of the map comes to lie."""
        return (self.turned @ (x, y) + self.offset).tolist()

    def yaw(self, yaw: float) -> float:
        """Return where a direction of the map comes to point."""
        return self._side * yaw + math.radians(self.degrees)


COPIES = (Placement(mirrored=True), Placement(137.0), Placement(offset=UTM),
          Placement(added=100_000))


def write_copy(game: Path, place: Placement, folder: Path) -> Path:
    """
    Write a copy of a game, with its scenario.

    :param game: its file.
    :param folder: for the files of this copy alone.
    :return: the copy's file.
    :raises InputError: if the game has something that cannot be placed anew.
    """
    given, folder = load_game(game), folder.resolve()
    values = placed(_values(given, place, str(game)), place)
    values['scenario'] = write_scenario_copy(given.scenario, place, folder)
    if place.mirrored:
        for human in values['humans']:
            human['driver'] = mirrored_driver(human['driver'], given.base, folder)
    path = folder / game.name
    path.write_text(yaml.safe_dump(values, sort_keys=False))
    return path


def _values(game: Game, place: Placement, where: str) -> dict[str, object]:
    """Return the values of a game without relative file names."""
    if game.occupancy is not None and place.added == 0:
        raise InputError('its map of obstacles cannot be placed anew', where, 'test it as it is')
    if place.mirrored and any(parse_source(human.driver).kind in ('replay', 'policy')
                              for human in game.humans):
        raise InputError('its driver cannot be mirrored', where, 'test it as it is')
    # Expressions of what varies are not placed anew.
    return write(replace(game, vary=()), game.base)


def placed(values: Any, place: Placement) -> Any:
    """Return the values of a game's file with coordinates and ids of its map placed anew."""
    if isinstance(values, list):
        return [placed(each, place) for each in values]
    if not isinstance(values, dict):
        return values
    found: dict[str, object] = {}
    side = -1.0 if place.mirrored else 1.0
    for key, value in values.items():
        if key == 'at' and isinstance(value, list):
            found[key] = [*place.point(*value[:2]), *map(place.yaw, value[2:])]
        elif key == 'path' and isinstance(value, list):
            found[key] = [place.point(*each) for each in value]
        elif key == 'trajectory' and isinstance(value, list):
            found[key] = [[t, *place.point(x, y), *map(place.yaw, yaw)] for t, x, y, *yaw in value]
        elif key == 'd' and place.mirrored:
            found[key] = -value
        elif key == 'sensors':
            # They are on their vehicle: only left and right may change.
            found[key] = [{name: side * part if name in ('y', 'yaw') else part
                           for name, part in each.items()} for each in value]
        elif key in _ID and isinstance(value, int):
            found[key] = value + place.added
        elif key in _IDS:
            found[key] = [each + place.added for each in value]
        elif key in ('between', 'vehicle'):
            found[key] = _renamed(value, place)
        else:
            found[key] = placed(value, place)
    if {'x', 'y'} <= values.keys():
        found['x'], found['y'] = place.point(values['x'], values['y'])
        if 'radius' not in values:
            found['yaw'] = place.yaw(values.get('yaw', 0.0))
    return found


def _renamed(value: object, place: Placement) -> object:
    """Return ids of objects, of which o30 is the scenario's obstacle 30."""
    if isinstance(value, list):
        return [_renamed(each, place) for each in value]
    number = value[1:] if isinstance(value, str) and value.startswith('o') else ''
    return f'o{int(number) + place.added}' if number.isdecimal() else value


def write_scenario_copy(source: Path, place: Placement, folder: Path) -> str:
    """Write a scenario placed anew, and return the path as text."""
    folder.mkdir(parents=True, exist_ok=True)
    if place.mirrored or place.added:
        source = _edited_scenario(source, place, folder / f'edited-{source.name}')
    scenario, problems = CommonRoadFileReader(str(source)).open()
    for each in (scenario, problems):
        each.translate_rotate(np.zeros(2), math.radians(place.degrees))
        each.translate_rotate(np.array(place.offset), 0.0)
    return write_exactly(scenario, problems, folder / source.name.removeprefix('edited-'))


def write_exactly(scenario: Scenario, problems: PlanningProblemSet, path: Path) -> str:
    """Write a scenario with all digits of its coordinates; return the path as text."""
    # It tells of each file that it replaces.
    path.unlink(missing_ok=True)
    CommonRoadFileWriter(scenario, problems, decimal_precision=DIGITS).write_to_file(
        str(path), OverwriteExistingFile.ALWAYS)
    return str(path)


def _edited_scenario(path: Path, place: Placement, to: Path) -> Path:
    """Write a CommonRoad file, left and right exchanged or with other ids; return its path."""
    tree = ElementTree.parse(path)
    for element in tree.iter():
        for key in ('id', 'ref'):
            if element.get(key, '').isdecimal():
                element.set(key, str(int(element.get(key, '0')) + place.added))
        if place.mirrored:
            _mirror(element)
    tree.write(to, encoding='utf-8', xml_declaration=True)
    return to


def _mirror(element: 'ElementTree.Element[str]') -> None:
    element.tag = _SIDES.get(element.tag, element.tag)
    if element.tag == 'direction' and element.text:
        element.text = _DIRECTIONS.get(element.text.strip(), element.text)
    if element.tag in _LATERAL:
        for value in (element, *element):
            if value.text and value.text.strip():
                value.text = repr(-float(value.text))
        ends = {each.tag: each for each in element}
        if 'intervalStart' in ends:
            ends['intervalStart'].tag, ends['intervalEnd'].tag = 'intervalEnd', 'intervalStart'


def mirrored_driver(driver: str, base: Path, folder: Path) -> str:
    """Write a driver's timeline with left and right exchanged, and return the driver."""
    source = parse_source(driver)
    if not source.has_timeline:
        return driver
    path = base / source.argument
    values = read_yaml(path, 'timeline')
    for held in values.get('keys', ()):
        keys = [held['hold']] if isinstance(held['hold'], str) else held['hold']
        held['hold'] = [_SIDES.get(key, _LAMPS.get(key, key)) for key in keys]
    if 'joy' in values:
        column = 1 + values['joy']['axes'].index('steering')
        for point in values['joy']['points']:
            point[column] = -point[column]
    mirrored = folder / path.name
    mirrored.write_text(yaml.safe_dump(values))
    return f'{source.kind}:{mirrored}'


_LAMPS = {'left_indicator': 'right_indicator', 'right_indicator': 'left_indicator'}
