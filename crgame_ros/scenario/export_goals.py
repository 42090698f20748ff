# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The goals of exported planning problems, and whether a run can be exported."""

from collections.abc import Mapping, Sequence
import pickle

from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.errors import InputError
from crgame_ros.game.objects import ObjectDescription
from crgame_ros.geometry.shape import Shape
from crgame_ros.scenario.export_document import (
    goal_position,
    goal_state,
    interval_bounds,
    lanelet_references,
    placed_rectangle,
    planning_problem,
    static_obstacle,
    whole,
)
from crgame_ros.scenario.export_ids import IdPool
from crgame_ros.scenario.export_network import framed, schema_errors, used_ids, write_roads
from crgame_ros.scenario.loading import LoadedScenario
from lxml import etree
import numpy as np
from numpy.typing import NDArray

# Margins of the goal area around a vehicle's last footprint [m], along and across.
_MARGIN = (5.0, 1.0)
# Cache of runs that can be exported, by what determines that, the oldest first; and its size.
_writable: dict[tuple[object, ...], None] = {}
_KEPT = 64
_ORIGIN = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def goal_where_it_ended(centers: NDArray[np.float64], shape: Shape) -> str:
    """
    Return a goal from the place where a vehicle ended, and the time steps that it spent there.

    :param centers: (K, 3) poses of its centre at the time steps from 0 on
    """
    length, width = shape.length + 2.0 * _MARGIN[0], shape.width + 2.0 * _MARGIN[1]
    cos, sin = np.cos(centers[-1, 2]), np.sin(centers[-1, 2])
    delta = centers[:, :2] - centers[-1, :2]
    along, across = delta @ (cos, sin), delta @ (-sin, cos)
    outside = np.flatnonzero((np.abs(along) > 0.5 * length) | (np.abs(across) > 0.5 * width))
    arrived = int(outside[-1]) + 1 if len(outside) else 0
    return goal_state((arrived, len(centers) - 1),
                      placed_rectangle(length, width, centers[-1].tolist()))


def goals_of(problem: PlanningProblem, vehicle_id: str, shift: int, last: int,
             lanelets: Mapping[int, int], notices: list[str]) -> list[str]:
    """
    Return the goals of a planning problem, with the time steps of the run.

    A problem without a goal gets one that every state of the run meets.

    :param shift: scenario step that is time step 0
    :param lanelets: ids of lanelets in the file, by their ids in the scenario
    :param notices: extended by remarks on changes
    """
    goals = []
    by_lanelet = problem.goal.lanelets_of_goal_position or {}
    for index, state in enumerate(problem.goal.state_list):
        start, end = (int(bound) - shift for bound in interval_bounds(state.time_step))
        if end < 1:
            notices.append(f'{vehicle_id}: the time of its goal is over before the first step; it '
                           'may be reached at any step of the run')
            start, end = 0, last
        known = [lanelets[number] for number in by_lanelet.get(index, ()) if number in lanelets]
        position = lanelet_references(known)
        if not known and state.has_value('position'):
            position = goal_position(state.position)
        goals.append(goal_state((max(start, 0), end), position, [
            (name, *interval_bounds(getattr(state, name)))
            for name in ('orientation', 'velocity') if state.has_value(name)]))
    if not goals:
        notices.append(f'{vehicle_id}: its planning problem has no goal; it gets one that every '
                       'state of the run meets')
        goals.append(goal_state((0, last), ''))
    return goals


def refuse_unwritable(loaded: LoadedScenario, objects: Sequence[ObjectDescription],
                      problems: Sequence[int]) -> None:
    """
    Write everything that does not depend on the run's course, and check it by the schema.

    :param objects: objects that can appear in the run; their shapes are checked.
    :param problems: ids of the planning problems that are driven.
    :raises InputError: if the run could not be exported.
    """
    shapes = tuple(dict.fromkeys(item.shape for item in objects))
    known = {problem.planning_problem_id: problem for problem in loaded.planning_problems}
    decides = (loaded.sha256, shapes, pickle.dumps([known[number] for number in problems]))
    if decides in _writable:
        return
    roads = write_roads(loaded, 0, [])
    frame = framed(roads.elements)
    ids = IdPool(used_ids([frame]), [])
    text = [static_obstacle(ids.fresh(), 'unknown', whole(shape), _ORIGIN[:3]) for shape in shapes]
    written = [planning_problem(ids.fresh(), _ORIGIN, goals_of(
        known[number], str(number), 0, 1, roads.lanelets, [])) for number in problems]
    last = frame[-1]
    for element in map(etree.fromstring, text):
        last.addprevious(element)
    frame.extend(map(etree.fromstring, written))
    if errors := schema_errors(frame):
        raise InputError(f'a run in it could not be exported ({errors[0]})', loaded.source,
                         'correct the scenario')
    _writable[decides] = None
    if len(_writable) > _KEPT:
        del _writable[next(iter(_writable))]
