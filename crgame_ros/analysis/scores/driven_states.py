# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A vehicle's drive as states of CommonRoad's kinematic single-track model."""

from collections.abc import Sequence
import math
from typing import NamedTuple

from commonroad.common.solution import vehicle_parameters, VehicleType
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.state import KSState, PMState, TraceState
from commonroad.scenario.trajectory import Trajectory
from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.geometry.reference_point import shifted
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.scenario.exact_values import group_outline
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray

# Dimensions that differ by no more are equal [m].
_SAME = 1e-6
# Around the box of a goal's area, for rounding [m].
_BOX_MARGIN = 0.1


class ChosenType(NamedTuple):
    """
    The vehicle type of CommonRoad that represents a vehicle.

    :param kind: number 1 to 4 in benchmark ids.
    :param difference: sum of the differences in length, width, wheelbase and position of the
        centre [m]
    """

    kind: VehicleType
    difference: float

    @property
    def is_exact(self) -> bool:
        """Return whether the type has the vehicle's dimensions."""
        return self.difference < _SAME


def choose_type(vehicle: VehicleParameters) -> ChosenType:
    """Return the one of CommonRoad's four vehicle types with the nearest dimensions."""
    found = []
    for kind, known in vehicle_parameters.items():
        differences = (known.l - vehicle.length, known.w - vehicle.width,
                       known.a + known.b - vehicle.wheelbase, known.b - vehicle.rear_to_center)
        found.append((sum(map(abs, differences)), kind.value))
    least, number = min(found)
    return ChosenType(VehicleType(number), least)


def driven_states(log: RunTrajectories, vehicle: int, kind: VehicleType,
                  first_step: int = 0) -> list[KSState]:
    """
    Return a vehicle's states of the KS model, at all steps of a run.

    The rear axle keeps its position; the model's centre is ahead of it by the type's own distance.

    :param vehicle: its number among the driven ones.
    :param first_step: time step of the first state.
    """
    states = log.vehicle_states[:, vehicle]
    centers = shifted(states[:, :3], vehicle_parameters[kind].b)
    yaws = wrap_pi_array(states[:, StateColumn.YAW])
    return [
        KSState(time_step=first_step + row, position=centers[row, :2].copy(),
                steering_angle=float(states[row, StateColumn.STEERING_ANGLE]),
                velocity=float(states[row, StateColumn.SPEED]), orientation=float(yaws[row]))
        for row in range(len(states))]


def point_mass_states(states: Sequence[KSState], kind: VehicleType) -> list[PMState]:
    """
    Return the states of a point mass at the centre of a vehicle of the KS model.

    The velocity of the centre has the part of the rear axle's along the heading, and across it
    the yaw rate v tan(delta) / (a + b) times the distance b between them.
    """
    known = vehicle_parameters[kind]
    return [
        PMState(time_step=state.time_step, position=state.position.copy(),
                velocity=state.velocity * math.cos(state.orientation)
                - across * math.sin(state.orientation),
                velocity_y=state.velocity * math.sin(state.orientation)
                + across * math.cos(state.orientation))
        for state in states
        for across in (known.b * state.velocity * math.tan(state.steering_angle)
                       / (known.a + known.b),)]


def goal_step(problem: PlanningProblem, states: Sequence[KSState | PMState]) -> int | None:
    """Find the first state that meets the goal; None without one."""
    if not problem.goal.state_list:
        return None
    positions = np.array([state.position for state in states])
    # CommonRoad's test copies the goal for each state, which takes a fifth of a millisecond.
    near = np.any([_is_near(goal, positions) for goal in problem.goal.state_list], axis=0)
    return next((number for number in np.flatnonzero(near).tolist()
                 if is_reached(problem, states[number])), None)


def _is_near(goal: TraceState, positions: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which positions (K, 2) may be in a goal's area: those in the box around it."""
    if getattr(goal, 'position', None) is None:
        return np.ones(len(positions), dtype=bool)
    low, high = np.reshape(group_outline(goal.position).bounds, (2, 2))
    return np.asarray(((positions >= low - _BOX_MARGIN)
                       & (positions <= high + _BOX_MARGIN)).all(axis=1))


def is_reached(problem: PlanningProblem, state: KSState | PMState) -> bool:
    """Return whether a state meets the goal; a goal on a value that the state lacks is not met."""
    try:
        return bool(problem.goal.is_reached(state))
    except (AttributeError, ValueError):
        return False


def until_goal(states: Sequence[KSState | PMState], step: int | None) -> Trajectory:
    """Return the trajectory up to the goal, as a solution needs it."""
    kept = states if step is None else states[:max(step, 1) + 1]
    return Trajectory(kept[0].time_step, list(kept))
