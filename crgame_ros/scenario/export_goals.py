# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The goals of exported planning problems."""

from collections.abc import Mapping

from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.geometry.shape import Shape
from crgame_ros.scenario.export_elements import (
    goal_position,
    goal_state,
    interval_bounds,
    lanelet_references,
    placed_rectangle,
)
import numpy as np
from numpy.typing import NDArray

# Margins of the goal area around a vehicle's last footprint [m], along and across.
_MARGIN = (5.0, 1.0)


def goal_where_it_ended(centers: NDArray[np.float64], shape: Shape) -> str:
    """
    Return a goal from the place where a vehicle ended, and the time steps that it spent there.

    :param centers: (K, 3) poses of its centre at the time steps from 0 on
    :param shape: shape of the vehicle
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
    :param last: last time step
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
