# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks whether a vehicle model could drive a trajectory, and by how much it falls short."""

from collections.abc import Callable
from dataclasses import dataclass
import math
from typing import TYPE_CHECKING

from commonroad.common.solution import PlanningProblemSolution, TrajectoryType, VehicleModel
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.state import TraceState
from commonroad.scenario.trajectory import Trajectory
from crgame_ros.errors import one_line
from crgame_ros.finite_json import finite
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # Importing the checker takes a second.
    from crgame_ros.analysis.scores.checker import VehicleDynamics

FloatArray = NDArray[np.float64]

_INPUTS = (TrajectoryType.Input, TrajectoryType.PMInput)
# The checker's tolerance is a distance that does not depend on the step: over shorter steps nearly
# any transition passes [s].
LEAST_STEP_S = 0.1
# If the norm of all errors [m], [m/s], [rad] is below this, the state is within each tolerance of
# the checker, whatever better inputs the checker might find.
_NEAR = 0.02
# Inputs beyond the limits by less than this are rounding errors [share].
_ROUNDING = 1e-3


@dataclass(frozen=True)
class TrajectoryFeasibility:
    """
    The drivability checker's result for a trajectory.

    :param feasible: whether every transition is feasible; None where it could not be checked.
    :param first_step: time step at which the first infeasible transition begins; None: none.
    :param reason: why that one is infeasible, or why it could not be checked; empty otherwise.
    :param transitions: number of transitions checked.
    :param infeasible: number of infeasible transitions.
    :param position_error: largest distance between a state and the model's step from the state
        before, with inputs that lead near enough or else fit best [m]
    :param heading_error: likewise for the heading [rad]
    :param excess_acceleration: excess of the needed acceleration over the model's limit [m/s^2]
    :param excess_steering_rate: likewise for the steering rate [rad/s]
    :param excess_friction: likewise for the magnitude of the longitudinal and lateral
        acceleration [m/s^2]
    :param step_s: time of a transition; that of the last one may be shorter [s]
    """

    feasible: bool | None
    first_step: int | None
    reason: str
    transitions: int = 0
    infeasible: int = 0
    position_error: float = 0.0
    heading_error: float = 0.0
    excess_acceleration: float = 0.0
    excess_steering_rate: float = 0.0
    excess_friction: float = 0.0
    step_s: float = 0.0

    def as_dict(self) -> dict[str, object]:
        """Return the fields as a JSON-compatible dictionary."""
        return {
            'feasible': self.feasible, 'first_step': self.first_step, 'reason': self.reason,
            'transitions': self.transitions, 'infeasible': self.infeasible,
            # Infinite where no inputs were found.
            'position_error_m': finite(self.position_error),
            'heading_error_rad': finite(self.heading_error),
            'excess_acceleration_m_s2': self.excess_acceleration,
            'excess_steering_rate_rad_s': self.excess_steering_rate,
            'excess_friction_m_s2': self.excess_friction, 'step_s': self.step_s}


def check_feasibility(found: PlanningProblemSolution, problem: PlanningProblem, dt_s: float,
                      progress: Callable[[float], object] = lambda _: None
                      ) -> TrajectoryFeasibility:
    """
    Check every transition of a solution's trajectory with the drivability checker.

    If time steps are shorter than `LEAST_STEP_S`, a transition combines enough of them; the last
    one combines what is left.

    :param dt_s: time step [s]
    :param progress: called with the share checked so far, 0 to 1.
    """
    if found.trajectory_type in _INPUTS:
        return _check_inputs(found, problem, dt_s)
    dynamics = _dynamics(found)
    stride = max(1, math.ceil(LEAST_STEP_S / dt_s - 1e-9))
    every = found.trajectory.state_list
    states = every[::stride]
    if states[-1] is not every[-1]:
        # A shorter last transition, or the end would not be checked.
        states.append(every[-1])
    if len(states) < 2:
        return TrajectoryFeasibility(None, None, 'the trajectory has no transition')
    measured = []
    for number, (now, then) in enumerate(zip(states[:-1], states[1:], strict=True)):
        try:
            step_s = (int(then.time_step) - int(now.time_step)) * dt_s
            measured.append(_transition(now, then, dynamics, step_s))
        except Exception as error:  # the checker can raise any exception
            return TrajectoryFeasibility(
                None, int(now.time_step), one_line(f'{type(error).__name__}: {error}'))
        progress((number + 1) / (len(states) - 1))
    feasible = np.array([each[0] for each in measured])
    worst = np.max([each[1] for each in measured], axis=0).tolist()
    bad = np.flatnonzero(~feasible)
    first = int(bad[0]) if len(bad) else None
    return TrajectoryFeasibility(
        not len(bad), None if first is None else int(states[first].time_step),
        '' if first is None else _why(*measured[first][1]), len(feasible), len(bad), worst[0],
        worst[1], worst[2], worst[3], worst[4], stride * dt_s)


def _dynamics(found: PlanningProblemSolution) -> 'VehicleDynamics':
    from crgame_ros.analysis.scores.checker import VehicleDynamics
    return VehicleDynamics.from_model(found.vehicle_model, found.vehicle_type)


def _transition(now: TraceState, then: TraceState, dynamics: 'VehicleDynamics', step_s: float
                ) -> tuple[bool, tuple[float, float, float, float, float]]:
    """Check one transition; return the verdict, both errors and the excess over three limits."""
    start, end = dynamics.state_to_array(now)[0], dynamics.state_to_array(then)[0]
    from crgame_ros.analysis.scores.checker import feasibility_checker
    made, feasible = _apparently_made(start, end, dynamics, step_s), True
    if made is None:
        feasible, inputs = feasibility_checker.state_transition_feasibility(
            now, then, dynamics, step_s)
        best = dynamics.input_to_array(inputs)[0]
        made = dynamics.forward_simulation(start, best, step_s, throw=False)
    limit = float(dynamics.parameters.longitudinal.a_max)
    if dynamics.vehicle_model is VehicleModel.PM:
        needed = math.hypot(*((end[2:4] - start[2:4]) / step_s).tolist())
        position = math.inf if made is None else math.dist(made[:2], end[:2])
        return bool(feasible), (position, 0.0, 0.0, 0.0, max(0.0, needed - limit))
    acceleration = float(end[3] - start[3]) / step_s
    rate = float(end[2] - start[2]) / step_s
    bound = dynamics.parameters.steering
    turn = math.remainder(float(end[4] - start[4]), 2.0 * math.pi) / step_s
    across = 0.5 * float(start[3] + end[3]) * turn
    errors = (math.inf, math.inf) if made is None else (
        math.dist(made[:2], end[:2]),
        abs(math.remainder(float(made[4] - end[4]), 2.0 * math.pi)))
    return bool(feasible), (
        *errors, max(0.0, abs(acceleration) - limit),
        max(0.0, rate - float(bound.v_max), float(bound.v_min) - rate),
        max(0.0, math.hypot(acceleration, across) - limit))


def _apparently_made(start: FloatArray, end: FloatArray, dynamics: 'VehicleDynamics',
                     step_s: float) -> FloatArray | None:
    """
    Return the next state of model KS or PM with the inputs that imply those states themselves.

    These are the steering rate and acceleration, or the accelerations along both axes.

    :return: the state; None if it is not near the target, and better inputs have to be searched.
    """
    if dynamics.vehicle_model not in (VehicleModel.KS, VehicleModel.PM):
        return None
    made = dynamics.forward_simulation(start, (end[2:4] - start[2:4]) / step_s, step_s,
                                       throw=False)
    if made is None:
        return None
    errors = made - end
    if dynamics.vehicle_model is VehicleModel.KS:
        errors[4] = math.remainder(float(errors[4]), 2.0 * math.pi)
    return np.asarray(made) if np.linalg.norm(errors) < _NEAR else None


def _why(position: float, heading: float, acceleration: float, rate: float,
         friction: float) -> str:
    if acceleration > _ROUNDING:
        return f'it needs {acceleration:.2f} m/s^2 more than the greatest acceleration'
    if rate > _ROUNDING:
        return f'it steers {rate:.2f} rad/s faster than the model can'
    if friction > _ROUNDING:
        return f'along and across it needs {friction:.2f} m/s^2 more than the tyres give'
    if not math.isfinite(position):
        return 'no inputs within the limits were found'
    return (f'the model comes out {100.0 * position:.1f} cm and {math.degrees(heading):.2f} deg '
            'beside it')


def _check_inputs(found: PlanningProblemSolution, problem: PlanningProblem,
                  dt_s: float) -> TrajectoryFeasibility:
    """Check a solution that holds inputs: each input must be within bounds and friction."""
    try:
        feasible, made = _driven(found, problem, dt_s)
    except ValueError as error:
        return TrajectoryFeasibility(None, None, str(error))
    last = int(made.state_list[-1].time_step)
    return TrajectoryFeasibility(
        feasible, None if feasible else last,
        '' if feasible else 'its input is beyond the bounds or the friction circle',
        len(found.trajectory.state_list), 0 if feasible else 1, step_s=dt_s)


def simulated(found: PlanningProblemSolution, problem: PlanningProblem,
              dt_s: float) -> Trajectory:
    """
    Return a solution's states; for inputs, those of the model, until an input is out of bounds.

    :raises ValueError: if the model cannot be driven with the inputs.
    """
    return _driven(found, problem, dt_s)[1] if found.trajectory_type in _INPUTS \
        else found.trajectory


def _driven(found: PlanningProblemSolution, problem: PlanningProblem,
            dt_s: float) -> tuple[bool, Trajectory]:
    """Return whether all inputs of a solution are within bounds, and the states up to there."""
    dynamics = _dynamics(found)
    from crgame_ros.analysis.scores.checker import feasibility_checker
    try:
        feasible, made = feasibility_checker.input_vector_feasibility(
            problem.initial_state, found.trajectory, dynamics, dt_s)
    except Exception as error:  # the checker can raise any exception
        raise ValueError(one_line(f'{type(error).__name__}: {error}')) from error
    return bool(feasible), made
