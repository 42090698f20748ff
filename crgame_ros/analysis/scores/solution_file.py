# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads and writes solution files of CommonRoad, and validates them."""

from datetime import datetime
import math
from pathlib import Path

from commonroad.common.solution import (
    CommonRoadSolutionReader,
    CommonRoadSolutionWriter,
    PlanningProblemSolution,
    Solution,
)
from crgame_ros.errors import InputError
from crgame_ros.scenario import guard
from lxml import etree

ROOT = 'CommonRoadSolution'
_REMEDY = 'compare it with what CommonRoadSolutionWriter writes'


def read_solution(path: Path) -> Solution:
    """
    Read a solution file, and validate its content.

    :raises InputError: if it is no solution file, or contains numbers that are not finite, time
        steps that are not consecutive, or no state.
    """
    source = str(path)
    root = guard.parse_hardened(guard.read_text(path), source, ROOT)
    states = sum(len(trajectory) for trajectory in root)
    if not 0 < states <= guard.MAX_TIME_STEP:
        raise InputError(f'has {states} states', source, 'give a file with trajectories')
    _check_numbers(root, source)
    try:
        solution = CommonRoadSolutionReader.fromstring(etree.tostring(root).decode())
    except Exception as error:  # commonroad-io can raise any exception
        text = str(error) or 'no further explanation'
        raise InputError(f'commonroad-io cannot read it ({type(error).__name__}: {text[:200]})',
                         source, _REMEDY) from error
    if len(solution.planning_problem_solutions) < len(root):
        raise InputError('a planning problem is solved twice in it', source, 'remove one of them')
    for found in solution.planning_problem_solutions:
        _check_steps(found, source)
    return solution


def solution_text(solution: Solution) -> str:
    """Return a solution as XML text, as commonroad-io writes it."""
    return str(CommonRoadSolutionWriter(solution).dump())


def solution_name(solution: Solution, vehicle_id: str = '') -> str:
    """Return a solution's file name, without colons, which some file systems refuse."""
    name = solution.benchmark_id.replace(':', '_')
    return f'solution_{name}{f".{vehicle_id}" if vehicle_id else ""}.xml'


def dated(solution: Solution, when: datetime | None) -> Solution:
    """Set the date at which a solution was made, None for no date, and return the solution."""
    solution.date = None if when is None else when.replace(tzinfo=None, microsecond=0)
    return solution


def _check_numbers(root: etree._Element, source: str) -> None:
    for leaf in root.iter('*'):
        if len(leaf):
            continue
        try:
            value = float(leaf.text or '')
        except ValueError:
            value = math.nan
        if not abs(value) <= guard.MAX_MAGNITUDE:
            raise InputError(f'<{leaf.tag}> is "{(leaf.text or "")[:40]}"',
                             guard.where(leaf, source), 'give a finite number')


def _check_steps(found: PlanningProblemSolution, source: str) -> None:
    states = found.trajectory.state_list
    steps = [state.time_step for state in states]
    where = f'{source}, planning problem {found.planning_problem_id}'
    if steps != list(range(steps[0], steps[0] + len(steps))) or steps[0] < 0:
        raise InputError('its time steps are not consecutive', where,
                         'give a state for every time step')
