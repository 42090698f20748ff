# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The sampling-based planner commonroad-reactive-planner 2025.1 as its authors ship it."""

from typing import ClassVar

from crgame_ros.errors import InputError, PlanningError
from crgame_ros.messages.plan import Plan, PlanRequest
from crgame_ros.planner.interface import PlannerContext
from crgame_ros.planner.path_planner import check_positive, PathPlanner
from crgame_ros.planner.reactive_core import configuration, ReactiveCore
from crgame_ros.planner.reference_path import DrivingPath
from crgame_ros.vehicle.parameters import VehicleParameters


class ReactivePackagePlanner(PathPlanner):
    """
    The planner commonroad-reactive-planner with its own samples, costs and desired speed.

    This class adds what the package needs to run: the reference path, the predicted obstacles and
    the road as collision objects, one process instead of six that may wait for ever, and states
    with the vehicle's own limits. The rest is the package's: sampling levels 1 to 3 in turn,
    lateral ends from -3 to 3 m, and the speed of the goal's middle or of the start, regardless of
    signs, lights and bends. As shipped it plans 6 s and takes up to a second, in which the AV
    follows the last plan. A shorter horizon and fewer levels make it faster.

    :param v0: desired speed; None takes the package's choice [m/s]
    :param horizon: length of a plan; the package's default is 60 steps of 0.1 s [s]
    :param levels: number of sampling levels, of which the first is not used; at least 2
    """

    name: ClassVar[str] = 'reactive-package'

    def __init__(self, v0: float | None = None, horizon: float = 6.0, levels: int = 4) -> None:
        check_positive(self.name, v0=v0, horizon=horizon)
        if not levels >= 2:
            raise InputError(f'"levels" is {levels!r}', f'options of planner {self.name}',
                             'give 2 or more')
        self._v0 = v0
        self._horizon = horizon
        self._levels = levels

    def setup(self, context: PlannerContext) -> None:
        """Plan the path and build the package's planner."""
        super().setup(context)
        config = configuration(context, self._horizon)
        config.sampling.num_sampling_levels = self._levels
        self._core = ReactiveCore(context, config, margin=0.0)
        self._desired = self._v0
        if not context.planning_problem.goal.state_list:
            # The package reads the speed from the goal, or from the start if the goal has none.
            self._desired = self._v0 or float(context.planning_problem.initial_state.velocity)

    def prepare(self, driving: DrivingPath, vehicle: VehicleParameters) -> None:
        """Do nothing: only the path is needed."""

    def plan(self, request: PlanRequest) -> Plan:
        """
        Plan over the horizon.

        :raises PlanningError: if no sample is feasible and free of collisions.
        """
        position = self.locate(request)
        self._core.start(request, self._driving, position)
        self._core.planner.set_desired_velocity(
            self._desired, current_speed=max(request.ego.speed, 0.0))
        states = self._core.plan()
        if states is None:
            raise PlanningError('no sample is feasible and free of collisions')
        return self.answer(request, states)
