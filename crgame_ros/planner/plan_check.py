# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of a plan: the reasons for a refusal, and how far off the road it may be."""

from dataclasses import dataclass
import math
from typing import TYPE_CHECKING

from crgame_ros.geometry.angles import wrap_pi, wrap_pi_array
from crgame_ros.geometry.reference_point import shifted
from crgame_ros.messages.plan import Plan
from crgame_ros.planner.interface import PlannerContext
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import StateColumn, VehicleState
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from crgame_ros.roads.boundary import RoadBoundary

Array = NDArray[np.float64]
# Least and greatest number of states of a plan; greatest magnitude in one [m], [rad], [m/s], …
SHORTEST, LONGEST = 2, 3000
LARGEST = 1e9
# A plan may reach this much further off the road than its start, for a rear overhang in a narrow
# bend, or a lane that was drawn narrower than the vehicle [m].
TOLERANCE = 0.2
# The same at walking speed, to get through a bend that is too narrow, and that speed [m, m/s].
SLOW_TOLERANCE, SLOW = 0.5, 2.0
# At this distance a pose is off every road [m].
FAR = 1e6


@dataclass(frozen=True)
class PlanTolerances:
    """
    The tolerances of a plan, on top of the vehicle's limits.

    Tolerances are needed because planners discretise and the request may be a perceived state.
    The defaults admit the planners that ship with the package and refuse a jump of 1 m or twice
    the maximum speed.

    :param start_position: distance of state 0 from the request's ego [m]
    :param start_yaw: its heading error [rad]
    :param start_speed: its speed error [m/s]
    :param jump: error between displacement and mean speed times step [m]
    :param jump_share: the same as a share of the displacement [-]
    :param speed: beyond the vehicle's speed range [m/s]
    :param acceleration: beyond a_max, forwards and backwards [m/s^2]
    :param lateral_acceleration: beyond friction times gravity [m/s^2]
    :param yaw: change of heading beyond what the tightest turn allows in a step [rad]
    :param steering: beyond the steering limit, and of a step beyond the rate limit [rad]
    :param steering_rate_share: of the steering rate beyond its limit [-]
    """

    start_position: float = 0.5
    start_yaw: float = 0.15
    start_speed: float = 1.0
    jump: float = 0.25
    jump_share: float = 0.05
    speed: float = 0.5
    acceleration: float = 1.0
    lateral_acceleration: float = 1.0
    yaw: float = 0.03
    steering: float = 0.03
    steering_rate_share: float = 0.25


DEFAULT_TOLERANCES = PlanTolerances()


def check_start(plan: Plan, request_ego: VehicleState, request_stamp_ns: int,
                tolerances: PlanTolerances = DEFAULT_TOLERANCES) -> str | None:
    """
    Check that a plan answers a request: stamp, shape, finite numbers, first state.

    :return: the reason for a refusal, or None.
    """
    if plan.stamp_ns != request_stamp_ns:
        return (f'the plan has the stamp {plan.stamp_ns} ns, the request has '
                f'{request_stamp_ns} ns')
    states = plan.states
    if len(states) > LONGEST:
        return f'the plan has {len(states)} states; at most {LONGEST} are allowed'
    if len(states) < SHORTEST:
        return f'the plan has {len(states)} state; at least {SHORTEST} are needed'
    # In this form, NaN is too large.
    fits = np.abs(states) <= LARGEST
    if not fits.all():
        row, column = np.argwhere(~fits)[0]
        return f'{StateColumn(column).name.lower()} of state {row} is {states[row, column]:g}'
    x, y, yaw, speed = states[0, :4].tolist()
    distance = math.hypot(x - request_ego.x, y - request_ego.y)
    if distance > tolerances.start_position:
        return f'the first state is {distance:.2f} m from the vehicle'
    if abs(wrap_pi(yaw - request_ego.yaw)) > tolerances.start_yaw:
        return ('the first state has another heading than the vehicle, by '
                f'{wrap_pi(yaw - request_ego.yaw):.2f} rad')
    if abs(speed - request_ego.speed) > tolerances.start_speed:
        return ('the first state has another speed than the vehicle, by '
                f'{speed - request_ego.speed:+.2f} m/s')
    return None


def check_plan(plan: Plan, request_ego: VehicleState, request_stamp_ns: int,
               vehicle: VehicleParameters, time_step_s: float,
               tolerances: PlanTolerances = DEFAULT_TOLERANCES) -> str | None:
    """
    Check that a plan answers a request and that the vehicle can follow it.

    :param request_ego: the ego state that the planner received (the perceived one).
    :param time_step_s: Delta t_c, the time between the plan's rows [s]
    :return: the reason for a refusal, with the state and the limit, or None.
    """
    return check_start(plan, request_ego, request_stamp_ns, tolerances) or _check_limits(
        plan.states, vehicle, time_step_s, tolerances)


def _check_limits(states: Array, vehicle: VehicleParameters, dt_s: float,
                  tolerances: PlanTolerances) -> str | None:
    speed, steering = states[:, StateColumn.SPEED], states[:, StateColumn.STEERING_ANGLE]
    change = states[1:, :5] - states[:-1, :5]
    turn = wrap_pi_array(change[:, StateColumn.YAW])
    mean = 0.5 * (speed[1:] + speed[:-1])
    expected = mean * dt_s
    middle = states[:-1, StateColumn.YAW] + 0.5 * turn
    error = np.hypot(change[:, 0] - expected * np.cos(middle),
                     change[:, 1] - expected * np.sin(middle))
    covered = np.abs(expected)
    tightest = math.tan(vehicle.max_steering_angle) / vehicle.wheelbase
    grip = vehicle.friction * vehicle.gravity + tolerances.lateral_acceleration
    fastest = vehicle.max_acceleration + tolerances.acceleration
    rate = vehicle.max_steering_rate * (1.0 + tolerances.steering_rate_share)
    checks = (
        ('speed', speed - vehicle.max_speed, tolerances.speed, 'm/s beyond the limit'),
        ('speed in reverse', -speed - vehicle.max_reverse_speed, tolerances.speed,
         'm/s beyond the limit'),
        ('jump', error, tolerances.jump + tolerances.jump_share * covered,
         f'm from where its speed leads in {dt_s:g} s'),
        ('acceleration', np.abs(change[:, StateColumn.SPEED]) / dt_s, fastest, 'm/s^2'),
        ('stated acceleration', np.abs(states[1:, StateColumn.ACCELERATION]), fastest, 'm/s^2'),
        ('lateral acceleration', np.abs(mean * turn) / dt_s, grip, 'm/s^2'),
        ('change of heading', np.abs(turn), tightest * covered + tolerances.yaw, 'rad'),
        ('steering angle', np.abs(steering[1:]) - vehicle.max_steering_angle,
         tolerances.steering, 'rad beyond the limit'),
        ('change of steering', np.abs(change[:, StateColumn.STEERING_ANGLE]),
         rate * dt_s + tolerances.steering, 'rad'))
    for what, values, limit, unit in checks:
        excess = values - limit
        # Written so that NaN fails.
        if not np.maximum.reduce(excess) <= 0.0:
            worst = int(excess.argmax())
            first = worst + (len(values) < len(states))
            return f'{what} of {values[worst]:.2f} {unit} at state {first}'
    return None


class RoadLimit:
    """
    A check of a vehicle's poses against the road and its present overhang.

    :param road: boundary of the road; None if the vehicle may leave it.
    """

    def __init__(self, road: 'RoadBoundary | None', vehicle: VehicleParameters) -> None:
        self._shape = vehicle.shape
        self._rear_to_center = vehicle.rear_to_center
        self._road = road
        self._now = 0.0

    @classmethod
    def from_context(cls, context: PlannerContext) -> 'RoadLimit':
        """Create the limit of a planner, and build the road boundary around the start."""
        # Without a lanelet there is no road that could be left.
        if not context.keep_road or not context.scenario.lanelet_network.lanelets:
            return cls(None, context.vehicle)
        start = context.planning_problem.initial_state.position
        context.road.prepare([(float(start[0]), float(start[1]))])
        return cls(context.road, context.vehicle)

    def start(self, ego: VehicleState) -> None:
        """Set the vehicle's present state: poses may be no further off the road than it is."""
        x, y = ego.center(self._rear_to_center)
        self._now = self._overhang(x, y, ego.yaw)

    def is_beyond(self, x: float, y: float, yaw: float, tolerance: float = 0.0) -> bool:
        """
        Return whether a pose is off the road, further than now.

        :param x: of the vehicle's centre [m]
        :param y: likewise [m]
        :param tolerance: by which it may be further off [m]
        """
        if self._road is None or not self._road.is_off_road(x, y, yaw, self._shape):
            return False
        allowed = self._now + tolerance
        return allowed == 0.0 or self._road.overhang(x, y, yaw, self._shape) > allowed

    def rehearse(self, ego: VehicleState) -> None:
        """Check a plan on the road and one off it: the first of each takes milliseconds longer."""
        ways = np.tile(np.array(ego), (2, 1))
        ways[1, :2] += FAR
        self.refusal(ways)

    def refusal(self, states: Array) -> str | None:
        """Return how far a plan leaves the road and where, or None; as `first_beyond`."""
        found = self.first_beyond(states)
        return None if found is None else \
            f'the plan leaves the road by {found[1]:.2f} m at state {found[0]}'

    def first_beyond(self, states: Array) -> tuple[int, float] | None:
        """
        Find where a plan, whose first state is the vehicle's, leaves the road, in 0.1 ms.

        :param states: (S, 8) finite rear-axle states
        :return: the first state that is too far off the road, and by how much [m]; None without.
        """
        if self._road is None:
            return None
        centers = shifted(states[:, :3], self._rear_to_center)
        off = np.flatnonzero(self._road.are_off_road(centers, self._shape))
        if not len(off):
            return None
        now = self._overhang(*centers[0].tolist()) if off[0] == 0 else 0.0
        beyond = off[self._road.are_beyond(centers[off], self._shape, now + TOLERANCE)]
        slow = np.abs(states[beyond, StateColumn.SPEED]) <= SLOW
        if slow.any():
            slow[slow] = ~self._road.are_beyond(centers[beyond[slow]], self._shape,
                                                now + SLOW_TOLERANCE)
            beyond = beyond[~slow]
        if not len(beyond):
            return None
        return int(beyond[0]), self._overhang(*centers[beyond[0]].tolist())

    def _overhang(self, x: float, y: float, yaw: float) -> float:
        if self._road is None or not self._road.is_off_road(x, y, yaw, self._shape):
            return 0.0
        return self._road.overhang(x, y, yaw, self._shape)
