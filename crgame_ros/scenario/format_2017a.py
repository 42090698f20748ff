# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Scenario files of CommonRoad 2017a as files of 2018b, which commonroad-io reads.

The older format has no `initialState` of obstacles: it is the first state of the trajectory. Goals
are the states of a `goalRegion`, and times may be seconds.
"""

from collections.abc import Iterable

from lxml import etree

VERSION = '2017a'
_SUCCESSOR = '2018b'
_TIMES = './/time/exact', './/time/intervalStart', './/time/intervalEnd'
# A time in seconds is taken for a multiple of the time step if it is one to this share of it.
_TOLERANCE = 1e-3


def upgrade(root: etree._Element) -> list[str]:
    """
    Turn a file of 2017a into one of 2018b; others stay as they are.

    :param root: changed in place; what cannot be turned is left for the guard to refuse.
    :return: what was done, one line.
    """
    if root.get('commonRoadVersion') != VERSION:
        return []
    root.set('commonRoadVersion', _SUCCESSOR)
    for obstacle in root.iterchildren('obstacle'):
        _split_trajectory(obstacle)
    for problem in root.iterchildren('planningProblem'):
        for region in problem.findall('goalRegion'):
            for state in region.findall('state'):
                state.tag = 'goalState'
                region.addprevious(state)
            problem.remove(region)
    seconds = _seconds_to_steps(root)
    return [f'it is of version {VERSION} and was read as {_SUCCESSOR}'
            + (', its times as seconds' if seconds else '')]


def _split_trajectory(obstacle: etree._Element) -> None:
    trajectory = obstacle.find('trajectory')
    if obstacle.find('initialState') is not None or trajectory is None or not len(trajectory):
        return
    first = trajectory[0]
    first.tag = 'initialState'
    trajectory.addprevious(first)
    if obstacle.findtext('role') == 'static':
        obstacle.remove(trajectory)


def _seconds_to_steps(root: etree._Element) -> bool:
    """Divide times by the time step where one of them is no whole number; False if none is."""
    nodes = [node for path in _TIMES for node in root.iterfind(path)]
    try:
        step = float(root.get('timeStepSize', ''))
        times = [float(node.text or '') for node in nodes]
        if step <= 0.0 or not _on_grid(times, step) or all(
                (node.text or '').strip().lstrip('+-').isdecimal() for node in nodes):
            return False
    except (OverflowError, ValueError):
        return False
    for node, time in zip(nodes, times, strict=True):
        node.text = str(round(time / step))
    return True


def _on_grid(times: Iterable[float], step: float) -> bool:
    return all(abs(time / step - round(time / step)) < _TOLERANCE for time in times)
