# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The interface between the simulation and a motion planner.

A planner is one class with `setup` and `plan`; see `docs/planners.md`. Poses of the ego are
rear-axle poses, those of obstacles are centre poses, all in the CommonRoad scenario frame.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, TYPE_CHECKING

from crgame_ros.game.objects import ObjectDescription
from crgame_ros.messages.plan import Plan, PlanRequest
from crgame_ros.vehicle.parameters import VehicleParameters

if TYPE_CHECKING:  # Some processes that read messages need no scenario.
    from commonroad.planning.planning_problem import PlanningProblem
    from commonroad.scenario.scenario import Scenario
    from crgame_ros.roads.boundary import RoadBoundary


@dataclass(frozen=True)
class PlannerContext:
    """
    The data that a planner gets once, before its first request.

    :param vehicle_id: the AV it drives (av0, …).
    :param scenario: the CommonRoad scenario; its obstacles are for reference only: each request
        has the actual ones.
    :param planning_problem: the AV's planning problem.
    :param vehicle: parameters of the AV.
    :param objects: description of every object that may appear in a request, by id.
    :param time_step_s: scenario step Delta t_c [s], the grid of requests and plans.
    :param k0: scenario time step at which the run starts.
    :param seed: seed for planners that draw random numbers.
    :param keep_road: whether a plan may not leave the road; the game's `drivability: {road:}`.
    """

    vehicle_id: str
    scenario: 'Scenario'
    planning_problem: 'PlanningProblem'
    vehicle: VehicleParameters
    objects: Mapping[str, ObjectDescription]
    time_step_s: float
    k0: int = 0
    seed: int = 0
    keep_road: bool = True

    @cached_property
    def road(self) -> 'RoadBoundary':
        """Return the boundary of the scenario's road, built at first use: call it in `setup`."""
        from crgame_ros.roads.boundary import RoadBoundary
        return RoadBoundary(self.scenario.lanelet_network)


class Planner(ABC):
    """
    A motion planner: one class, one file.

    Options from the game file arrive as keyword arguments of the constructor; unknown ones
    must raise `InputError`, which a signature without `**kwargs` does through the registry.

    A class that sets `wants_lights` gets others' lights and horn (`PlanRequest.lights`).
    """

    name: ClassVar[str]
    wants_lights: ClassVar[bool] = False

    @abstractmethod
    def setup(self, context: PlannerContext) -> None:
        """
        Prepare for a scenario; called again when the scenario changes.

        :raises PlanningError: if the planner cannot work on this scenario.
        """

    @abstractmethod
    def plan(self, request: PlanRequest) -> Plan:
        """
        Plan from the requested state.

        :return: a plan whose stamp is the request's and whose first state is the ego's.
        :raises PlanningError: if no plan is found.
        """
