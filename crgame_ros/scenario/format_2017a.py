# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Converts scenario files of CommonRoad 2017a to 2018b, which commonroad-io reads.

The older format is inferred from programs of its time that write and read it (the library `fvks`
of its authors, their MATLAB tools, early `opendrive2lanelet`). Obstacles have no `initialState`:
it is the first state of the trajectory or the first occupancy. Static obstacles have only a
shape, placed on the map. Goals are the states of a `goalRegion`, also with points and exact
values. Times are in seconds, in some files in time steps.
"""

from collections.abc import Iterable

from lxml import etree

VERSION = '2017a'
_SUCCESSOR = '2018b'
_TIMES = './/time/exact', './/time/intervalStart', './/time/intervalEnd'
# Tolerance for a time to count as a multiple of the time step [time steps].
_TOLERANCE = 1e-3
# Fields of a goal in 2018b.
_GOAL_FIELDS = ('position', 'orientation', 'velocity', 'time')
# Radius in which a goal at a point is met [m].
_GOAL_RADIUS = 1.0


def upgrade(root: etree._Element) -> list[str]:
    """
    Convert a file of 2017a to 2018b; leave other versions unchanged.

    :param root: changed in place; the guard refuses what cannot be converted.
    :return: remarks on the changes.
    """
    if root.get('commonRoadVersion') != VERSION:
        return []
    root.set('commonRoadVersion', _SUCCESSOR)
    for neighbour in root.iterfind('lanelet/*[@drivingDirection]'):
        neighbour.set('drivingDir', neighbour.attrib.pop('drivingDirection'))
    for obstacle in root.iterchildren('obstacle'):
        _add_initial_state(obstacle)
    notices = []
    for problem in root.iterchildren('planningProblem'):
        first = problem.find('state')
        if first is not None and problem.find('initialState') is None:
            first.tag = 'initialState'
        for region in problem.findall('goalRegion'):
            for state in region.findall('state'):
                state.tag = 'goalState'
                notices += _make_goal(state, problem.get('id', ''))
                region.addprevious(state)
            problem.remove(region)
    seconds = _seconds_to_steps(root)
    return [f'it is of version {VERSION} and was read as {_SUCCESSOR}'
            + (', its times as seconds' if seconds else ''), *notices]


def _add_initial_state(obstacle: etree._Element) -> None:
    """Add the initial state that 2018b requires to an obstacle."""
    if obstacle.find('initialState') is not None:
        return
    trajectory, occupancies = obstacle.find('trajectory'), obstacle.find('occupancySet')
    if trajectory is not None and len(trajectory):
        first = trajectory[0]
        first.tag = 'initialState'
        trajectory.addprevious(first)
        if obstacle.findtext('role') == 'static':
            obstacle.remove(trajectory)
    elif occupancies is not None and len(occupancies):
        first = occupancies[0]
        shape, time = first.find('shape'), first.find('time')
        if shape is not None and time is not None:
            for given in obstacle.findall('shape'):
                obstacle.remove(given)
            occupancies.remove(first)
            occupancies.addprevious(shape)
            _place(shape, time)
    elif (shape := obstacle.find('shape')) is not None:
        time = etree.Element('time')
        etree.SubElement(time, 'exact').text = '0'
        _place(shape, time)


def _place(shape: etree._Element, time: etree._Element) -> None:
    """Write a shape's place on the map as an initial state, and centre the shape at the origin."""
    centers = shape.findall('*/center') + shape.findall('polygon/point')
    try:
        points = [(float(point.findtext('x', '')), float(point.findtext('y', '')))
                  for point in centers]
    except ValueError:
        # The guard refuses it, with its name.
        return
    if not points:
        return
    anchor = [sum(values) / len(points) for values in zip(*points, strict=True)]
    for point, place in zip(centers, points, strict=True):
        for tag, value, origin in zip('xy', place, anchor, strict=True):
            point.find(tag).text = repr(value - origin)
    turn = '0.0'
    if len(shape) == 1 and shape[0].tag == 'rectangle':
        turn = shape[0].findtext('orientation', turn)
        for name in ('orientation', 'center'):
            for element in shape[0].findall(name):
                shape[0].remove(element)
    state = etree.Element('initialState')
    point = etree.SubElement(etree.SubElement(state, 'position'), 'point')
    for tag, value in zip('xy', anchor, strict=True):
        etree.SubElement(point, tag).text = repr(value)
    etree.SubElement(etree.SubElement(state, 'orientation'), 'exact').text = turn
    state.append(time)
    shape.addnext(state)


def _make_goal(state: etree._Element, problem: str) -> list[str]:
    """Convert a goal's fields to intervals and areas of 2018b; return remarks on the changes."""
    notices = []
    for field in list(state):
        if field.tag not in _GOAL_FIELDS:
            state.remove(field)
            notices.append(f'planning problem {problem}: the {field.tag} of its goal is ignored')
        exact = field.find('exact')
        if exact is not None:
            exact.tag = 'intervalStart'
            etree.SubElement(field, 'intervalEnd').text = exact.text
    for point in state.findall('position/point'):
        circle = etree.Element('circle')
        etree.SubElement(circle, 'radius').text = repr(_GOAL_RADIUS)
        point.addprevious(circle)
        point.tag = 'center'
        circle.append(point)
        notices.append(f'planning problem {problem}: its goal is a point, which is met within '
                       f'{_GOAL_RADIUS:g} m')
    return notices


def _seconds_to_steps(root: etree._Element) -> bool:
    """Divide times by the time step if any is not a whole number; return whether that was so."""
    nodes = [node for path in _TIMES for node in root.iterfind(path)]
    try:
        step = float(root.get('timeStepSize', ''))
        times = [float(node.text or '') for node in nodes]
        # A goal's interval may begin and end between two time steps.
        strict = [time for node, time in zip(nodes, times, strict=True)
                  if node.getparent().getparent().tag != 'goalState']
        if step <= 0.0 or not _on_grid(strict, step) or all(
                (node.text or '').strip().lstrip('+-').isdecimal() for node in nodes):
            return False
        steps = [str(round(time / step)) for time in times]
    except (OverflowError, ValueError):
        return False
    for node, text in zip(nodes, steps, strict=True):
        node.text = text
    return True


def _on_grid(times: Iterable[float], step: float) -> bool:
    return all(abs(time / step - round(time / step)) < _TOLERANCE for time in times)
