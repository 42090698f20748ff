# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A planner that always holds its speed: the simplest opponent."""

import math
from typing import ClassVar, Literal

from crgame_ros.geometry.polyline import ReferencePath
from crgame_ros.messages.plan import Plan, PlanRequest
from crgame_ros.planner.interface import PlannerContext
from crgame_ros.planner.path_following import covering_steps, PathFollower
from crgame_ros.planner.path_planner import check_positive, PathPlanner
from crgame_ros.planner.reference_path import DrivingPath
from crgame_ros.vehicle.parameters import VehicleParameters
import numpy as np


class ConstantVelocityPlanner(PathPlanner):
    """
    A planner that holds the speed of the request on the reference path and ignores obstacles.

    :param path: `lane` follows the reference path, `straight` drives straight ahead.
    :param horizon: length of a plan [s]
    """

    name: ClassVar[str] = 'constant-velocity'

    def __init__(self, path: Literal['lane', 'straight'] = 'lane', horizon: float = 3.0) -> None:
        check_positive(self.name, horizon=horizon)
        self._straight = path == 'straight'
        self._horizon = horizon

    def setup(self, context: PlannerContext) -> None:
        """Plan the path; driving straight ahead needs none."""
        self._context = context
        if not self._straight:
            super().setup(context)

    def prepare(self, driving: DrivingPath, vehicle: VehicleParameters) -> None:
        """Do nothing: only the path is needed."""

    def plan(self, request: PlanRequest) -> Plan:
        """Plan at constant speed over the horizon."""
        steps = covering_steps(self._horizon, request.time_step_s)
        if self._straight:
            ego = request.ego
            ahead = np.array([[0.0], [abs(ego.speed) * self._horizon + 10.0]])
            line = (ego.x, ego.y) + ahead * (math.cos(ego.yaw), math.sin(ego.yaw))
            follower = PathFollower(ReferencePath.from_polyline(line), self._context.vehicle)
            position = follower.locate(ego.x, ego.y, ego.yaw, 0.0)
        else:
            position = self.locate(request)
            follower = self.follower
        states = follower.drive(request.ego, position, steps, request.time_step_s,
                                lambda i, s, speed: 0.0)
        return self.answer(request, states)
