# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The reward of a decision: a weighted sum of named terms."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
import math
from typing import NamedTuple

from commonroad.geometry.shape import Shape
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.state import KSState
from crgame_ros.analysis.criticality.criticality import COLUMN, MEASURES, TickMeasures
from crgame_ros.analysis.criticality.thresholds import USUAL
from crgame_ros.analysis.scores.driven_states import is_reached
from crgame_ros.errors import InputError
from crgame_ros.policy.route_guide import RoutePlace
from crgame_ros.scenario.exact_values import group_outline
from crgame_ros.vehicle.state import VehicleState
import numpy as np

# At a contact, the braking that avoids it is infinite; what it adds to a reward is not [m/s^2].
_HARDEST = MEASURES['drac'].most


class _Gate(NamedTuple):
    """The time steps and the area in which one of the goal's states can be met."""

    first_k: float
    last_k: float
    low_x: float
    low_y: float
    high_x: float
    high_y: float


class GoalWatch:
    """
    A check of the goal that calls commonroad-io only where time and position permit it.

    A call of commonroad-io takes half a millisecond.

    :param problem: the planning problem; None is never met.
    :param rear_to_center: distance from the vehicle's rear axle to its centre [m]
    """

    def __init__(self, problem: PlanningProblem | None, rear_to_center: float) -> None:
        self._problem, self._to_center = problem, rear_to_center
        self._gates = [] if problem is None else [
            _gate(state) for state in problem.goal.state_list]

    def is_met(self, state: VehicleState, k: int) -> bool:
        """
        Return whether a state meets the goal.

        :param state: state of the rear axle in scenario coordinates.
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
    return _Gate(first, last, *group_outline(position).bounds)


class Decision(NamedTuple):
    """
    The result of a decision.

    :param lapse_s: time since the decision [s]
    :param before: state at the decision.
    :param now: current state.
    :param place: current place on the route.
    :param collision: whether the vehicle has touched anything since.
    :param off_road: whether it has left the road since.
    :param goal: whether it is at its goal.
    :param measures: criticality measures to all near; None if no term needs them.
    """

    lapse_s: float
    before: VehicleState
    now: VehicleState
    place: RoutePlace
    collision: bool
    off_road: bool
    goal: bool
    measures: TickMeasures | None = None

    def shortage(self, measure: str, threshold: float) -> float:
        """Return the relative amount below a threshold: 0 if not below, 1 for a measure of 0."""
        value = self.worst(measure)
        return max(0.0, 1.0 - value / threshold) if value == value else 0.0

    def worst(self, measure: str) -> float:
        """Return the most critical value of a measure."""
        assert self.measures is not None
        return float(self.measures.worst()[0][COLUMN[measure]])


@dataclass(frozen=True)
class RewardTerm:
    """
    A term of the reward.

    :param unit: unit of its value.
    :param meaning: one sentence.
    :param value: returns its value for a decision.
    :param is_measured: whether it needs criticality measures.
    """

    unit: str
    meaning: str
    value: Callable[[Decision], float]
    is_measured: bool = False


def _driven_well(decision: Decision) -> float:
    place = decision.place
    share = decision.now.speed / place.speed_limit if place.speed_limit > 0.0 else 0.0
    return min(max(share, 0.0), 1.0)


TERMS: dict[str, RewardTerm] = {
    'progress': RewardTerm('m', 'come along the route since the last decision',
                           lambda it: it.place.progress),
    'speed': RewardTerm('-', 'speed as a share of the limit, 0 to 1', _driven_well),
    'speeding': RewardTerm('m/s', 'speed above the limit',
                           lambda it: max(0.0, it.now.speed - it.place.speed_limit)),
    'collision': RewardTerm('-', '1 if anything was touched since the last decision',
                            lambda it: float(it.collision)),
    'off_road': RewardTerm('-', '1 if a part of the vehicle was off the road since',
                           lambda it: float(it.off_road)),
    'goal': RewardTerm('-', "1 if the planning problem's goal is reached",
                       lambda it: float(it.goal)),
    'time': RewardTerm('s', 'simulated time since the last decision', lambda it: it.lapse_s),
    'offset': RewardTerm('m', 'distance of the rear axle from the route, to either side',
                         lambda it: abs(it.place.d)),
    'heading': RewardTerm('rad', 'heading error from the route, to either side',
                          lambda it: abs(it.place.heading_error)),
    'acceleration': RewardTerm('m^2/s^4', 'longitudinal acceleration, squared',
                               lambda it: it.now.acceleration ** 2),
    'jerk': RewardTerm('m^2/s^6', 'mean longitudinal jerk since, squared', lambda it: (
        (it.now.acceleration - it.before.acceleration) / it.lapse_s) ** 2),
    'lateral_acceleration': RewardTerm('m^2/s^4', 'speed times yaw rate, squared', lambda it: (
        it.now.speed * it.now.yaw_rate) ** 2),
    'steering_rate': RewardTerm('rad^2/s^2', 'mean rate of the steering angle since, squared',
                                lambda it: ((it.now.steering_angle - it.before.steering_angle)
                                            / it.lapse_s) ** 2),
    'ttc': RewardTerm('-', f'shortage of the time to collision below {USUAL.ttc_s:g} s, 0 to 1',
                      lambda it: it.shortage('ttc', USUAL.ttc_s), True),
    'thw': RewardTerm('-', 'shortage of the time headway below 2 s, 0 to 1',
                      lambda it: it.shortage('thw', 2.0), True),
    'ttc_2d': RewardTerm('-', f'shortage of the time to contact below {USUAL.ttc_s:g} s, 0 to 1',
                         lambda it: it.shortage('ttc_2d', USUAL.ttc_s), True),
    'min_distance': RewardTerm('-', 'shortage of the distance to everybody below 2 m, 0 to 1',
                               lambda it: it.shortage('min_distance', 2.0), True),
    'drac': RewardTerm(MEASURES['drac'].unit,
                       f'{MEASURES["drac"].definition}, at most {_HARDEST:g}',
                       lambda it: min(it.worst('drac'), _HARDEST), True),
    'a_req': RewardTerm(MEASURES['a_req'].unit, 'braking that just avoids contact, above 0, at '
                        f'most {_HARDEST:g}', lambda it: min(-min(0.0, it.worst('a_req')),
                                                             _HARDEST), True)}
USUAL_REWARD = {'progress': 0.05, 'offset': -0.02, 'jerk': -0.0002, 'collision': -10.0,
                'off_road': -10.0, 'goal': 5.0}


class Reward:
    """
    The weighted sum of terms.

    :param weights: by term; with 0 a term's value is still reported.
    :raises InputError: if there is no such term, or a weight is not a number.
    """

    def __init__(self, weights: Mapping[str, float]) -> None:
        for name, weight in weights.items():
            if name not in TERMS:
                raise InputError(f'there is no term "{name}"', 'reward',
                                 'use ' + ', '.join(TERMS))
            if isinstance(weight, bool) or not isinstance(weight, int | float) \
                    or not math.isfinite(weight):
                raise InputError(f'the weight of "{name}" is {weight!r}', 'reward',
                                 'give a finite number')
        self._terms = [(name, TERMS[name].value, float(weight))
                       for name, weight in weights.items()]
        self.is_measured = any(TERMS[name].is_measured for name in weights)

    def compute(self, decision: Decision) -> tuple[float, dict[str, float]]:
        """Return the reward, and the unweighted value of each term."""
        values = {name: value(decision) for name, value, _ in self._terms}
        return sum(weight * values[name] for name, _, weight in self._terms), values
