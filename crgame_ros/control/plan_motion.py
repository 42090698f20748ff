# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A plan as one continuous motion, and the motion of a vehicle that joins it late."""

import math

from crgame_ros.errors import InputError
from crgame_ros.geometry.angles import interpolate_angle, wrap_pi, wrap_pi_array
from crgame_ros.geometry.reference_point import joined
from crgame_ros.vehicle.idm_model import Number
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import PLANNED_REST, StateColumn, VehicleState
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# A late plan is joined with about this much acceleration on top of its own [m/s^2], with as much
# as it has itself where that is more, with at most this jerk [m/s^3], and not faster than in this
# time [s].
JOIN_ACCELERATION = 4.0
JOIN_JERK = 50.0
LEAST_JOIN_S = 1.0
# Offsets across the plan vanish on the way that is covered in the first of these times [s] that
# the vehicle can steer; a slow vehicle takes the way of this speed [m/s].
ACROSS_TIMES_S = (1.0, 2.0, 4.0)
SLOW = 4.0
# A vehicle farther beside the plan's path than this [m], or turned against it by more than this
# [rad], cannot join it.
FARTHEST = 3.0
STEEPEST = 0.7
# The square of a step that is too short to have a direction [m^2].
RESTING = 1e-12


class PlanMotion:
    """
    The motion between planned states.

    Positions are cubic in time, by heading and speed at both ends, and do not turn back between
    two states; speeds are those of this motion. A vehicle that comes to rest within the step, or
    drives off within it, brakes or accelerates constantly and rests for the remaining time.
    Headings are linear in the way covered, by the shortest turn, and the other columns in time.

    :param states: (S, 8) planned states, columns as in `StateColumn`, S >= 1
    :param time_step_s: Delta t_c [s]
    """

    def __init__(self, states: Array, time_step_s: float) -> None:
        self.states = states
        self.time_step_s = time_step_s
        self._rows: list[list[float]] = states.tolist()
        steps = states[1:, :2] - states[:-1, :2]
        speeds, yaws = states[:, StateColumn.SPEED], states[:, StateColumn.YAW]
        velocities = (speeds * time_step_s)[:, None] * joined(np.cos(yaws), np.sin(yaws))
        lengths = np.hypot(steps[:, 0], steps[:, 1])
        speeds = np.abs(speeds)
        ways = np.maximum(speeds * time_step_s, 1e-12)
        # When a vehicle moves in a step that begins or ends at rest, as shares of its time: with
        # the mean of both speeds it covers the way in less than the step.
        resting = speeds <= PLANNED_REST
        needed = 2.0 * lengths / (ways[:-1] + ways[1:])
        rests = (resting[:-1] != resting[1:]) & (needed < 1.0) & (lengths**2 > RESTING)
        self._spans = np.where(rests, needed, 1.0)
        self._begins = np.where(resting[:-1], 1.0 - self._spans, 0.0)
        self._motions: list[list[float]] = joined(self._begins, self._spans).tolist()
        # Beyond three times the step, a cubic would turn back.
        most, spans = 3.0 * lengths, self._spans[:, None]
        self._starts = spans * velocities[:-1] * np.minimum(
            1.0, most / (self._spans * ways[:-1]))[:, None]
        self._ends = spans * velocities[1:] * np.minimum(
            1.0, most / (self._spans * ways[1:]))[:, None]
        self._tangents: list[list[float]] = np.concatenate(
            (self._starts, self._ends), axis=1).tolist()

    def __len__(self) -> int:
        """Return the number of planned states."""
        return len(self._rows)

    def at(self, index: int, share: float) -> VehicleState:
        """Return the state at a share of the step from one planned state to the next."""
        first = self._rows[index]
        if share == 0.0:
            return VehicleState(*first)
        second = self._rows[index + 1]
        mixed = [a + share * (b - a) for a, b in zip(first, second, strict=True)]
        begin, span = self._motions[index]
        moving = min(max((share - begin) / span, 0.0), 1.0)
        start_x, start_y, end_x, end_y = self._tangents[index]
        mixed[0], along_x = _cubic(moving, first[0], second[0], start_x, end_x)
        mixed[1], along_y = _cubic(moving, first[1], second[1], start_y, end_y)
        step_x, step_y = second[0] - first[0], second[1] - first[1]
        square = step_x * step_x + step_y * step_y
        covered = share if square < RESTING else (
            (mixed[0] - first[0]) * step_x + (mixed[1] - first[1]) * step_y) / square
        yaw = interpolate_angle(first[StateColumn.YAW], second[StateColumn.YAW], covered)
        mixed[StateColumn.YAW] = yaw
        mixed[StateColumn.SPEED] = (
            along_x * math.cos(yaw) + along_y * math.sin(yaw)) / (span * self.time_step_s)
        return VehicleState(*mixed)

    def sample(self, at: Array) -> Array:
        """
        Return states at fractional indices.

        :param at: (M) ascending, from 0 to S - 1
        :return: (M, 8), the yaw continuous
        """
        states = self.states.copy()
        states[:, StateColumn.YAW] = np.unwrap(states[:, StateColumn.YAW])
        index = np.minimum(at.astype(np.intp), max(0, len(states) - 2))
        share = (at - index)[:, None]
        first, second = states[index], states[np.minimum(index + 1, len(states) - 1)]
        sampled = first + share * (second - first)
        if len(states) > 1:
            spans = self._spans[index]
            moving = np.clip((share[:, 0] - self._begins[index]) / spans, 0.0, 1.0)[:, None]
            sampled[:, :2], along = _cubic(moving, first[:, :2], second[:, :2],
                                           self._starts[index], self._ends[index])
            steps = second[:, :2] - first[:, :2]
            squares = np.einsum('ij,ij->i', steps, steps)
            moved = np.einsum('ij,ij->i', sampled[:, :2] - first[:, :2], steps)
            covered = np.where(squares < RESTING, share[:, 0],
                               moved / np.maximum(squares, RESTING))
            yaws = first[:, StateColumn.YAW] + covered * (
                second[:, StateColumn.YAW] - first[:, StateColumn.YAW])
            sampled[:, StateColumn.YAW] = yaws
            speeds = (along[:, 0] * np.cos(yaws) + along[:, 1] * np.sin(yaws)) / (
                spans * self.time_step_s)
            sampled[:, StateColumn.SPEED] = np.where(
                share[:, 0] == 0.0, first[:, StateColumn.SPEED], speeds)
        return np.asarray(sampled)


def _cubic(share: Number, first: Number, second: Number, start: Number,
           end: Number) -> tuple[Number, Number]:
    """Return the cubic Hermite polynomial between two values with given slopes, and its slope."""
    rest, step = 1.0 - share, second - first
    return (first + share * share * (3.0 - 2.0 * share) * step
            + share * rest * rest * start - share * share * rest * end,
            6.0 * share * rest * step + rest * (1.0 - 3.0 * share) * start
            - share * (2.0 - 3.0 * share) * end)


class JoinedMotion:
    """
    The motion of a vehicle into a plan that comes late: no jump in place, heading or speed.

    Along the plan, the differences in place, speed and acceleration vanish by a quintic polynomial
    in time; of a plan that is entered elsewhere, those in speed and acceleration by a cubic one.
    Across the plan, the differences in offset, heading and steering vanish by a quintic polynomial
    in the way covered. The vehicle keeps to its limits of acceleration and does not turn back.
    Beyond a change of gear the plan is not followed.

    :param plan: in simulation coordinates, S >= 2
    :param since: fractional index of the planned state where the vehicle should be now
    :param vehicle: its state now
    :param acceleration: with which it has come there, signed along its heading [m/s^2]
    :param parameters: of the vehicle
    :param dt_s: simulation step [s]
    :param in_time: whether the difference in place along the plan vanishes, too.
    :raises InputError: if the vehicle cannot join the plan.
    """

    def __init__(self, plan: PlanMotion, since: float, vehicle: VehicleState, acceleration: float,
                 parameters: VehicleParameters, dt_s: float, *, in_time: bool) -> None:
        self._parameters = parameters
        self._dt_s = dt_s
        per_state = plan.time_step_s / dt_s
        now = int(since * per_state + 1e-9)
        after = int((len(plan) - 1 - since) * per_state + 1e-9)
        path = plan.sample(np.clip(
            since + np.arange(-now, after + 1) / per_state, 0.0, len(plan) - 1.0))
        speeds = path[:, StateColumn.SPEED]
        self._direction = _direction(speeds, now, vehicle.speed)
        against = np.flatnonzero(self._direction * speeds < -PLANNED_REST)
        place = int(np.searchsorted(against, now))
        first = int(against[place - 1]) + 1 if place else 0
        last = int(against[place]) if place < len(against) else len(path)
        path, now = path[first:last], now - first
        steps = np.diff(path[:, :2], axis=0)
        self._way = np.concatenate(([0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))))
        heading = path[:, StateColumn.YAW] + (0.0 if self._direction > 0.0 else math.pi)
        self._columns = np.column_stack((path[:, :2], heading, path[:, StateColumn.STEERING_ANGLE],
                                         _curvatures(heading, self._way)))
        self._planned = self._direction * path[now:, StateColumn.SPEED], self._way[now:]
        self.states = self._join(vehicle, self._direction * acceleration, in_time)

    def _join(self, vehicle: VehicleState, acceleration: float, in_time: bool) -> Array:
        """Return the states (M, 8) from now on, a simulation step apart."""
        foot = self._foot(vehicle)
        x, y, heading, steering, curvature = (float(value) for value in self._at(foot))
        offset = (vehicle.y - y) * math.cos(heading) - (vehicle.x - x) * math.sin(heading)
        turn = wrap_pi(vehicle.yaw + (0.0 if self._direction > 0.0 else math.pi) - heading)
        if abs(offset) > FARTHEST or abs(turn) > STEEPEST:
            raise InputError(f'the plan comes too late: by now the vehicle is {abs(offset):.1f} m '
                             f'beside it and turned by {abs(turn):.1f} rad against it')
        speed = self._direction * vehicle.speed
        if speed < -PLANNED_REST:
            raise InputError('the plan comes too late: by now the vehicle moves in the other '
                             'direction')
        inner = 1.0 - curvature * offset
        slope = inner * math.tan(turn)
        speeds, ways = self._along(speed * math.cos(turn) / inner, acceleration, foot, in_time)
        # The curvature that the vehicle has beyond that of the path.
        wheelbase = self._parameters.wheelbase
        beyond = self._direction * (
            math.tan(vehicle.steering_angle) - math.tan(steering)) / wheelbase
        bend = ((curvature + beyond) * inner / math.cos(turn) - curvature) \
            * inner / math.cos(turn) ** 2 - curvature * slope * math.tan(turn)
        for across_s in ACROSS_TIMES_S:
            states = self._across(speeds, ways, across_s * max(speed, SLOW), (offset, slope, bend))
            if self._can_steer(states):
                states[0] = vehicle
                return states
        raise InputError('the plan comes too late: by now the vehicle cannot steer onto it')

    def _foot(self, vehicle: VehicleState) -> Array:
        """Return the way of the path's point beside the vehicle."""
        nearest = np.argmin((self._columns[:, 0] - vehicle.x) ** 2
                            + (self._columns[:, 1] - vehicle.y) ** 2)
        way = self._way[nearest]
        for _ in range(3):
            x, y, heading, _, _ = self._at(way)
            way = way + (vehicle.x - x) * np.cos(heading) + (vehicle.y - y) * np.sin(heading)
        return np.asarray(way)

    def _at(self, way: Array) -> list[Array]:
        """Return x, y, heading, steering, curvature at ways; both ends go on as circles."""
        x, y, heading, steering, curvature = (
            np.interp(way, self._way, column) for column in self._columns.T)
        beyond = way - np.clip(way, 0.0, self._way[-1])
        half = 0.5 * beyond * curvature
        chord = beyond * np.sinc(half / np.pi)
        return [x + chord * np.cos(heading + half), y + chord * np.sin(heading + half),
                heading + 2.0 * half, steering, curvature]

    def _along(self, speed: float, acceleration: float, foot: Array, in_time: bool
               ) -> tuple[Array, Array]:
        """
        Return the speeds (M) along the path from now on, and the ways (M).

        :param speed: along the path, now
        :param acceleration: likewise
        """
        planned, ways = self._planned
        ahead, faster = float(foot) - float(ways[0]), speed - float(planned[0])
        own = np.diff(planned) / self._dt_s
        # A vehicle at rest has no acceleration to get rid of.
        harder = acceleration - float(own[:1].sum()) if speed > PLANNED_REST else 0.0
        strength = max(JOIN_ACCELERATION, float(np.abs(own).max(initial=0.0)))
        # The jerk of the difference in acceleration is largest at the start: 9 a / T.
        least_s = max(LEAST_JOIN_S, 9.0 * abs(harder) / JOIN_JERK)
        times = self._dt_s * np.arange(len(planned))
        if in_time:
            # The accelerations of both differences are at most 6 e / T^2 and 4 w / T.
            join_s = max(least_s, (2.0 * abs(faster) + math.sqrt(
                4.0 * faster**2 + 6.0 * strength * abs(ahead))) / strength)
            t = np.minimum(times / join_s, 1.0)
            added = _vanishing(
                ahead, faster * join_s, 0.5 * harder * join_s**2).deriv()(t) / join_s
        else:
            join_s = max(least_s, 1.5 * abs(faster) / strength)
            t = np.minimum(times / join_s, 1.0)
            added = (1.0 - t) ** 2 * (faster * (1.0 + 2.0 * t) + harder * join_s * t)
        # Past the end only rounding is left.
        speeds = self._limited(np.maximum(planned + np.where(t < 1.0, added, 0.0), 0.0))
        added = speeds - planned
        gained = self._dt_s * np.concatenate(([0.0], np.cumsum(0.5 * (added[1:] + added[:-1]))))
        return speeds, np.maximum.accumulate(ways + ahead + gained)

    def _limited(self, speeds: Array) -> Array:
        """Return speeds (M) that the vehicle reaches within its limits of acceleration."""
        own = self._parameters
        curvature = self._columns[-len(speeds):, 4]
        most = np.sqrt(np.maximum(own.max_acceleration**2 - (speeds**2 * curvature) ** 2, 1.0))
        up = self._dt_s * np.minimum(
            most, own.max_acceleration * own.switching_speed / np.maximum(speeds, 1e-3))
        down = self._dt_s * most
        change = np.diff(speeds)
        if (change <= up[:-1]).all() and (change >= -down[:-1]).all():
            return speeds
        limited = speeds.tolist()
        for i in range(1, len(limited)):
            limited[i] = min(max(limited[i], limited[i - 1] - float(down[i - 1])),
                             limited[i - 1] + float(up[i - 1]))
        return np.array(limited)

    def _across(self, speeds: Array, ways: Array, length: float,
                start: tuple[float, float, float]) -> Array:
        """
        Return the states on a quintic polynomial across the path.

        :param length: of the way on which the differences vanish [m]
        :param start: offset, and its first and second derivative by the way
        """
        x, y, heading, steering, curvature = self._at(ways)
        u = np.minimum((ways - ways[0]) / length, 1.0)
        polynomial = _vanishing(start[0], start[1] * length, 0.5 * start[2] * length**2)
        offset, slope = polynomial(u), polynomial.deriv()(u) / length
        inner = 1.0 - curvature * offset
        turn = np.arctan2(slope, inner)
        cosine = np.cos(turn)
        bend = ((polynomial.deriv(2)(u) / length**2 + curvature * slope * np.tan(turn))
                * cosine**2 / inner + curvature) * cosine / inner
        wheelbase = self._parameters.wheelbase
        states = np.empty((len(ways), 8))
        states[:, StateColumn.X] = x - offset * np.sin(heading)
        states[:, StateColumn.Y] = y + offset * np.cos(heading)
        states[:, StateColumn.YAW] = wrap_pi_array(
            heading + turn - (0.0 if self._direction > 0.0 else math.pi))
        states[:, StateColumn.SPEED] = self._direction * speeds * np.hypot(inner, slope)
        states[:, StateColumn.STEERING_ANGLE] = steering + self._direction * (
            np.arctan(wheelbase * bend) - np.arctan(wheelbase * curvature))
        for rate, of in ((StateColumn.ACCELERATION, StateColumn.SPEED),
                         (StateColumn.YAW_RATE, StateColumn.YAW),
                         (StateColumn.STEERING_RATE, StateColumn.STEERING_ANGLE)):
            change = np.diff(states[:, of], prepend=states[0, of])
            states[:, rate] = (wrap_pi_array(change) if of == StateColumn.YAW else change) \
                / self._dt_s
        return states

    def _can_steer(self, states: Array) -> bool:
        """Return whether steering and grip suffice, or suffice no less than for the plan."""
        own = self._parameters
        planned, _ = self._planned
        steering = np.abs(self._columns[:, 3]).max()
        lateral = np.abs(planned**2 * self._columns[-len(planned):, 4]).max()
        return bool(
            np.abs(states[:, StateColumn.STEERING_ANGLE]).max()
            <= max(own.max_steering_angle, steering) + 1e-6
            and np.abs(states[:, StateColumn.SPEED] * states[:, StateColumn.YAW_RATE]).max()
            <= max(own.friction * own.gravity, lateral) + 0.5)


def _vanishing(first: float, second: float, third: float) -> np.polynomial.Polynomial:
    """Return the quintic with three coefficients that vanishes at 1, with two derivatives."""
    return np.polynomial.Polynomial((
        first, second, third, -10.0 * first - 6.0 * second - 3.0 * third,
        15.0 * first + 8.0 * second + 3.0 * third, -6.0 * first - 3.0 * second - third))


def _direction(speeds: Array, now: int, speed: float) -> float:
    """Return 1 for a plan that goes on forwards, or -1; the vehicle's own if all of it rests."""
    moving = np.flatnonzero(np.abs(speeds) > PLANNED_REST)
    if len(moving):
        speed = float(speeds[moving[min(int(np.searchsorted(moving, now)), len(moving) - 1)]])
    return -1.0 if speed < 0.0 else 1.0


def _curvatures(heading: Array, way: Array) -> Array:
    """Return the curvature of a path at its points; where it rests, that from before [1/m]."""
    steps = np.diff(way)
    moving = np.flatnonzero(steps > 1e-4)
    if not len(moving):
        return np.zeros(len(way))
    last = np.searchsorted(moving, np.arange(len(way)), side='right') - 1
    segment = moving[np.maximum(last, 0)]
    return np.asarray(np.diff(heading)[segment] / steps[segment])
