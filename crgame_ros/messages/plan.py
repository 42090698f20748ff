# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The request to a motion planner and its answer, the plan.

Poses of the ego are rear-axle poses, those of obstacles are centre poses, all in the CommonRoad
scenario frame.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from crgame_ros.errors import InputError
from crgame_ros.vehicle.lights import Light
from crgame_ros.vehicle.state import STATE_WIDTH, StateColumn, VehicleState
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class PlanRequest:
    """
    One atomic snapshot at scenario time step k, with predictions over P - 1 further steps.

    :param stamp_ns: simulation time of the snapshot [ns]; the plan repeats it.
    :param k: scenario time step.
    :param time_step_s: scenario step Delta t_c [s].
    :param ego: state of the planner's own vehicle (rear axle).
    :param obstacle_ids: (M) names; keys of `PlannerContext.objects`.
    :param obstacle_poses: (P, M, 3) centre x, y, yaw at k, k + 1, …; NaN where absent.
    :param obstacle_velocities: (P, M, 3) derivatives of the poses; NaN where absent.
    :param lights: present lights and horn of other driven vehicles that are seen, by their ids.
        Empty unless the planner wants them (`Planner.wants_lights`).
    """

    stamp_ns: int
    k: int
    time_step_s: float
    ego: VehicleState
    obstacle_ids: tuple[str, ...] = ()
    obstacle_poses: NDArray[np.float64] = field(default_factory=lambda: np.empty((1, 0, 3)))
    obstacle_velocities: NDArray[np.float64] = field(
        default_factory=lambda: np.empty((1, 0, 3)))
    lights: Mapping[str, Light] = field(default_factory=dict)


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
        """Check that the array is a list of states."""
        if self.states.ndim != 2 or self.states.shape[1] != STATE_WIDTH or not len(self.states):
            raise InputError(f'a plan has shape {self.states.shape}', 'plan',
                             f'give at least one row of {STATE_WIDTH} columns: '
                             + ', '.join(c.name.lower() for c in StateColumn))
