# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether a vehicle is at the goal of its planning problem, asked at every decision."""

import math
from typing import NamedTuple

from commonroad.geometry.shape import Shape
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.state import KSState
from crgame_ros.analysis.scores.driven_states import is_reached
from crgame_ros.policy.route_guide import goal_area
from crgame_ros.vehicle.state import VehicleState
import numpy as np


class _Gate(NamedTuple):
    """When and where one of the goal's states can be met at all."""

    first_k: float
    last_k: float
    low_x: float
    low_y: float
    high_x: float
    high_y: float


class GoalWatch:
    """
    Asks commonroad-io, which takes half a millisecond, only where time and place can be right.

    :param problem: the planning problem; None is never met.
    :param rear_to_center: of the vehicle [m]
    """

    def __init__(self, problem: PlanningProblem | None, rear_to_center: float) -> None:
        self._problem, self._to_center = problem, rear_to_center
        self._gates = [] if problem is None else [
            _gate(state) for state in problem.goal.state_list]

    def is_met(self, state: VehicleState, k: int) -> bool:
        """
        Return whether a state meets the goal.

        :param state: of the rear axle, scenario coordinates.
        :param k: its scenario time step.
        """
        if self._problem is None:
            return False
        x, y = state.center(self._to_center)
        if not any(gate.first_k <= k <= gate.last_k and gate.low_x <= x <= gate.high_x
                   and gate.low_y <= y <= gate.high_y for gate in self._gates):
            return False
        return is_reached(self._problem, KSState(
            time_step=k, position=np.array((x, y)), steering_angle=state.steering_angle,
            velocity=state.speed, orientation=state.yaw))


def _gate(goal: object) -> _Gate:
    time, position = getattr(goal, 'time_step', None), getattr(goal, 'position', None)
    first = -math.inf if time is None else float(getattr(time, 'start', time))
    last = math.inf if time is None else float(getattr(time, 'end', time))
    if not isinstance(position, Shape):
        return _Gate(first, last, -math.inf, -math.inf, math.inf, math.inf)
    return _Gate(first, last, *goal_area(position).bounds)
