# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The interface between the simulation and a motion planner.

A planner is one class with `setup` and `plan`; see `docs/planners.md`. Poses of the ego are
rear-axle poses, those of obstacles are centre poses, all in the CommonRoad scenario frame.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from crgame_ros.errors import InputError
from crgame_ros.scenario.objects import ObjectDescription
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import STATE_WIDTH, StateColumn, VehicleState

# Messages are read by processes that need no scenario.
if TYPE_CHECKING:
    from commonroad.planning.planning_problem import PlanningProblem
    from commonroad.scenario.scenario import Scenario

    from crgame_ros.drivability.road_boundary import RoadBoundary


@dataclass(frozen=True)
class PlannerContext:
    """
    What a planner is given once, before its first request.

    :param vehicle_id: the AV it drives (av0, …).
    :param scenario: the CommonRoad scenario; its obstacles are for reference only: what is
        really there comes with each request.
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
        """The boundary of the scenario's road, made at first use: ask for it in `setup`."""
        from crgame_ros.drivability.road_boundary import RoadBoundary
        return RoadBoundary(self.scenario.lanelet_network)


@dataclass(frozen=True)
class PlanRequest:
    """
    One atomic snapshot at scenario time step k, with predictions over P - 1 further steps.

    :param stamp_ns: simulation time of the snapshot [ns]; the plan carries it back.
    :param k: scenario time step.
    :param time_step_s: scenario step Delta t_c [s].
    :param ego: state of the planner's own vehicle (rear axle).
    :param obstacle_ids: (M) names; keys of `PlannerContext.objects`.
    :param obstacle_poses: (P, M, 3) centre x, y, yaw at k, k + 1, …; NaN where absent.
    :param obstacle_velocities: (P, M, 3) derivatives of the poses; NaN where absent.
    """

    stamp_ns: int
    k: int
    time_step_s: float
    ego: VehicleState
    obstacle_ids: tuple[str, ...] = ()
    obstacle_poses: NDArray[np.float64] = field(default_factory=lambda: np.empty((1, 0, 3)))
    obstacle_velocities: NDArray[np.float64] = field(
        default_factory=lambda: np.empty((1, 0, 3)))


@dataclass(frozen=True)
class Plan:
    """
    Planned states of the ego on the scenario grid; state 0 is at the request's time.

    :param stamp_ns: stamp of the request that this plan answers [ns].
    :param states: (S, 8) rear-axle states, columns as in `StateColumn`, rows Delta t_c apart.
    :param fallback: True when the planner failed and its adapter answered by braking.
    """

    stamp_ns: int
    states: NDArray[np.float64]
    fallback: bool = False

    def __post_init__(self) -> None:
        """Refuse an array that is no list of states."""
        if self.states.ndim != 2 or self.states.shape[1] != STATE_WIDTH or not len(self.states):
            raise InputError(f'a plan has shape {self.states.shape}', 'plan',
                             f'give at least one row of {STATE_WIDTH} columns: '
                             + ', '.join(c.name.lower() for c in StateColumn))


class Planner(ABC):
    """
    A motion planner: one class, one file.

    Options from the game file arrive as keyword arguments of the constructor; unknown ones
    must raise `InputError`, which a signature without `**kwargs` does through the registry.
    """

    name: ClassVar[str]

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


PlannerOptions = Mapping[str, Any]
