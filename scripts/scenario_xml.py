# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Writing a scenario as CommonRoad 2020a XML, the same bytes at every run.

The writer of commonroad-io puts today's date into the file and the members of sets in the order
of their hashes, which differs from process to process.
"""

from collections.abc import Sequence
from pathlib import Path

from lxml import etree
import numpy as np
from numpy.typing import NDArray
from scenario_maps import Incoming, Intersection, Lanelet, Obstacle, Problem, ScenarioFile, Sign

TIME_STEP_S = 0.1
# Until then a goal can be reached [s].
GOAL_S = 60.0
ZAMUNDA_GEO_NAME_ID = -999
NO_POSITION = 999


def write(scenario: ScenarioFile, directory: Path) -> Path:
    """Write `<benchmark id>.xml`, and return it."""
    root = etree.Element(
        'commonRoad', timeStepSize=str(TIME_STEP_S), commonRoadVersion='2020a',
        author='The crgame_ros authors', affiliation='crgame_ros',
        source='scripts/make_scenarios.py', benchmarkID=scenario.benchmark_id,
        date='2026-01-01')
    location = _add(root, 'location')
    _add(location, 'geoNameId', ZAMUNDA_GEO_NAME_ID)
    _add(location, 'gpsLatitude', NO_POSITION)
    _add(location, 'gpsLongitude', NO_POSITION)
    tags = _add(root, 'scenarioTags')
    for tag in scenario.tags:
        _add(tags, tag)
    for id_ in sorted(scenario.roads.lanelets):
        _lanelet(root, scenario.roads.lanelets[id_])
    for sign in scenario.roads.signs:
        _sign(root, sign)
    for intersection in scenario.roads.intersections:
        _intersection(root, intersection)
    for obstacle in sorted(scenario.obstacles, key=lambda o: (not o.is_static, o.id)):
        _obstacle(root, obstacle)
    for problem in scenario.problems:
        _problem(root, problem)
    path = directory / f'{scenario.benchmark_id}.xml'
    path.write_bytes(etree.tostring(root, pretty_print=True, xml_declaration=True,
                                    encoding='UTF-8'))
    return path


def _number(value: float) -> str:
    text = f'{value:.4f}'.rstrip('0').rstrip('.')
    return '0' if text == '-0' else text


def _add(parent: etree._Element, name: str, text: str | float = '',
         **attributes: str | int) -> etree._Element:
    element = etree.SubElement(parent, name,
                               {key: str(value) for key, value in attributes.items()})
    if text != '':
        element.text = text if isinstance(text, str) else _number(text)
    return element


def _exact(parent: etree._Element, name: str, value: float) -> None:
    _add(_add(parent, name), 'exact', value)


def _point(parent: etree._Element, position: Sequence[float] | NDArray[np.float64]) -> None:
    point = _add(parent, 'point')
    _add(point, 'x', float(position[0]))
    _add(point, 'y', float(position[1]))


def _lanelet(root: etree._Element, lanelet: Lanelet) -> None:
    element = _add(root, 'lanelet', id=lanelet.id)
    for name, bound, marking in (('leftBound', lanelet.left, lanelet.markings[0]),
                                 ('rightBound', lanelet.right, lanelet.markings[1])):
        side = _add(element, name)
        for position in bound:
            _point(side, position)
        _add(side, 'lineMarking', marking)
    for name, ids in (('predecessor', lanelet.predecessors), ('successor', lanelet.successors)):
        for id_ in ids:
            _add(element, name, ref=id_)
    for name in ('Left', 'Right'):
        if name in lanelet.neighbors:
            id_, direction = lanelet.neighbors[name]
            _add(element, f'adjacent{name}', ref=id_, drivingDir=direction)
    if lanelet.stop_line:
        marking, signs = lanelet.stop_line
        line = _add(element, 'stopLine')
        _point(line, lanelet.left[-1])
        _point(line, lanelet.right[-1])
        _add(line, 'lineMarking', marking)
        for id_ in signs:
            _add(line, 'trafficSignRef', ref=id_)
    for type_ in lanelet.types:
        _add(element, 'laneletType', type_)
    for user in lanelet.users:
        _add(element, 'userOneWay', user)
    for id_ in lanelet.signs:
        _add(element, 'trafficSignRef', ref=id_)


def _sign(root: etree._Element, sign: Sign) -> None:
    element = _add(root, 'trafficSign', id=sign.id)
    part = _add(element, 'trafficSignElement')
    _add(part, 'trafficSignID', sign.number)
    if sign.value:
        _add(part, 'additionalValue', sign.value)
    _point(_add(element, 'position'), sign.position)
    _add(element, 'virtual', 'false')


def _intersection(root: etree._Element, intersection: Intersection) -> None:
    element = _add(root, 'intersection', id=intersection.id)
    for incoming in intersection.incomings:
        _incoming(element, incoming)


def _incoming(parent: etree._Element, incoming: Incoming) -> None:
    element = _add(parent, 'incoming', id=incoming.id)
    for id_ in incoming.lanelets:
        _add(element, 'incomingLanelet', ref=id_)
    for turn in ('Right', 'Straight', 'Left'):
        for id_ in incoming.successors.get(turn.lower(), ()):
            _add(element, f'successors{turn}', ref=id_)
    if incoming.left_of is not None:
        _add(element, 'isLeftOf', ref=incoming.left_of)


def _obstacle(root: etree._Element, obstacle: Obstacle) -> None:
    role = 'static' if obstacle.is_static else 'dynamic'
    element = _add(root, f'{role}Obstacle', id=obstacle.id)
    _add(element, 'type', obstacle.type)
    shape = _add(element, 'shape')
    if len(obstacle.size) == 1:
        _add(_add(shape, 'circle'), 'radius', obstacle.size[0])
    else:
        rectangle = _add(shape, 'rectangle')
        _add(rectangle, 'length', obstacle.size[0])
        _add(rectangle, 'width', obstacle.size[1])
    _state(_add(element, 'initialState'), 0, obstacle.states[0])
    if not obstacle.is_static:
        trajectory = _add(element, 'trajectory')
        for step, state in enumerate(obstacle.states[1:], start=1):
            _state(_add(trajectory, 'state'), step, state)


def _state(element: etree._Element, step: int, state: NDArray[np.float64]) -> None:
    x, y, heading, speed = (float(value) for value in state)
    _point(_add(element, 'position'), (x, y))
    _exact(element, 'orientation', heading)
    _exact(element, 'time', step)
    _exact(element, 'velocity', speed)


def _problem(root: etree._Element, problem: Problem) -> None:
    element = _add(root, 'planningProblem', id=problem.id)
    initial = _add(element, 'initialState')
    _point(_add(initial, 'position'), problem.pose[:2])
    for name, value in (('orientation', problem.pose[2]), ('time', 0),
                        ('velocity', problem.speed), ('acceleration', 0.0), ('yawRate', 0.0),
                        ('slipAngle', 0.0)):
        _exact(initial, name, value)
    goal = _add(element, 'goalState')
    position = _add(goal, 'position')
    for id_ in problem.goal:
        _add(position, 'lanelet', ref=id_)
    time = _add(goal, 'time')
    _add(time, 'intervalStart', 0)
    _add(time, 'intervalEnd', round(GOAL_S / TIME_STEP_S))
