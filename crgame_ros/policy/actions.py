# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The meaning of a policy's actions, the same in training, offline and live."""

from collections.abc import Sequence
import math
from typing import get_args, Literal, NamedTuple

from crgame_ros.errors import PlanningError
from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.planner.path_following import covering_steps, Rollout
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED
from crgame_ros.vehicle.human_vehicle import HumanVehicle
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.powertrain import pedal_response, Powertrain
from crgame_ros.vehicle.state import STATE_WIDTH, StateColumn, VehicleState
from crgame_ros.vehicle.steering import load_steering_ratio, steering_rate
from crgame_ros.vehicle.stopping import moving_time
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ActionKind = Literal['acceleration', 'pedals', 'plan', 'manoeuvre']
ACTION_KINDS: tuple[ActionKind, ...] = get_args(ActionKind)
# Those that only an AV can do, since they become plans.
PLANNED_KINDS: tuple[ActionKind, ...] = ('plan', 'manoeuvre')
MANOEUVRES = ('keep', 'left', 'right', 'faster', 'slower')
# Acceleration for 1 and deceleration for -1 [m/s^2].
DRIVING, BRAKING = 4.0, 8.0
# The greatest curvature is the lower of those of full lock and of this lateral acceleration
# [m/s^2].
LATERAL = 5.0
# Length of the plan of an action, in case the next one is late [s].
HELD_S = 0.5
# Points of an action that is a plan, a scenario step apart.
PLAN_POINTS = 10
# Below this speed the steering angle is not computed from the heading's change [m/s].
_CREEPING = 0.5
# Iterations for the steering ratio, which depends on the steering-wheel angle to be found.
_ROUNDS = 6


class WantedMotion(NamedTuple):
    """
    The motion that the action `acceleration` demands.

    :param acceleration: along the heading [m/s^2]
    :param curvature: of the rear axle's path, left positive [1/m]
    """

    acceleration: float
    curvature: float


def action_bounds(kind: ActionKind) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """
    Return the least and greatest values of an action.

    :return: (2) for `acceleration` and `pedals`; (10, 4) for `plan`: x and y [m] of the rear axle
        as seen from its present pose, yaw from the present one [rad] and speed [m/s]; () for
        `manoeuvre`: a number of `MANOEUVRES`
    """
    if kind == 'manoeuvre':
        return np.array(0.0, np.float32), np.array(len(MANOEUVRES) - 1.0, np.float32)
    if kind == 'plan':
        row = np.array((100.0, 100.0, math.pi, 100.0), np.float32)
        high = np.tile(row, (PLAN_POINTS, 1))
        return -high, high
    return np.full(2, -1.0, np.float32), np.full(2, 1.0, np.float32)


def checked_action(kind: ActionKind, action: object) -> Array:
    """
    Return an action clipped to its bounds.

    :raises PlanningError: if it has another shape, or a number that is not finite; or if it is not
        the number of a manoeuvre.
    """
    low, high = action_bounds(kind)
    values = np.asarray(action, dtype=np.float64)
    if values.shape != low.shape or not np.isfinite(values).all():
        raise PlanningError(f'an action "{kind}" needs {low.shape} finite numbers, this is '
                            f'{np.array2string(values.ravel()[:6], precision=3)}'
                            f' of shape {values.shape}')
    if kind == 'manoeuvre' and not (low <= values <= high and float(values).is_integer()):
        raise PlanningError(f'an action "{kind}" is a number from 0 to {high:g}, this is '
                            f'{values:g}')
    return np.minimum(np.maximum(values, low), high)


def wanted_motion(action: Array, speed: float, vehicle: VehicleParameters) -> WantedMotion:
    """
    Return the motion that an action `acceleration` demands.

    :param action: (2) in [-1, 1]: 1 is 4 m/s^2, -1 is braking with 8 m/s^2; then the share of the
        greatest curvature at the vehicle's speed, left positive
    :param speed: of the vehicle [m/s]
    """
    pedal, turn = action.tolist()
    lock = math.tan(vehicle.max_steering_angle) / vehicle.wheelbase
    return WantedMotion(pedal * (DRIVING if pedal > 0.0 else BRAKING),
                        turn * min(lock, LATERAL / max(speed * speed, 1e-6)))


def pedals(action: Array) -> DriverCommand:
    """
    Return the command of an action `pedals`.

    :param action: (2) in [-1, 1]: throttle, below 0 brake; steering wheel, left positive
    """
    pedal, steering = action.tolist()
    return DriverCommand(max(pedal, 0.0), max(-pedal, 0.0), steering)


def held_steps(dt_s: float) -> int:
    """Return the steps of a plan that holds an action, one at least."""
    return max(1, covering_steps(HELD_S, dt_s))


def planned_states(kind: ActionKind, action: Array, ego: VehicleState,
                   vehicle: VehicleParameters, dt_s: float, substeps: int) -> Array:
    """
    Return the planned states of an action; for manoeuvres see `policy.manoeuvres`.

    :param action: from `checked_action`.
    :param ego: present state, rear axle.
    :param dt_s: scenario step [s]
    :param substeps: simulation steps in it, for the motion of a vehicle driven by pedals.
    :return: (S, 8) rear-axle states, a scenario step apart, the first the ego's
    """
    if kind == 'plan':
        return _stated(action, ego, vehicle, dt_s)
    steps = held_steps(dt_s)
    if kind == 'pedals':
        return _driven(pedals(action), ego, vehicle, steps, dt_s, substeps)
    wanted = wanted_motion(action, ego.speed, vehicle)
    angle = math.atan(vehicle.wheelbase * wanted.curvature)
    drive = Rollout(ego, dt_s, vehicle.wheelbase)
    for _ in range(steps):
        speed, acceleration = drive.speed, wanted.acceleration
        if speed <= 0.0 and acceleration < 0.0:
            # Brakes hold a standing vehicle, and stop one that rolls backwards.
            acceleration = BRAKING if speed < 0.0 else 0.0
        acceleration = min(acceleration, (vehicle.max_speed - speed) / dt_s)
        moving_s = moving_time(speed, acceleration, dt_s)
        rate = steering_rate(angle, drive.steering, moving_s, vehicle.max_steering_rate) \
            if moving_s > 0.0 else 0.0
        drive.step(acceleration, rate, moving_s)
    return drive.states


def _driven(command: DriverCommand, ego: VehicleState, vehicle: VehicleParameters, steps: int,
            dt_s: float, substeps: int) -> Array:
    """Return the states of a human's vehicle under a constant command."""
    driven, states = HumanVehicle(vehicle, ego), [ego]
    for _ in range(steps):
        for _ in range(substeps):
            driven.step(command, dt_s / substeps)
        states.append(driven.state)
    return np.array(states, dtype=np.float64)


def _stated(points: Array, ego: VehicleState, vehicle: VehicleParameters, dt_s: float) -> Array:
    """Return complete states from the x, y, yaw and speed of an action."""
    states = np.empty((len(points) + 1, STATE_WIDTH))
    states[0] = ego
    cos, sin = math.cos(ego.yaw), math.sin(ego.yaw)
    states[1:, StateColumn.X] = ego.x + cos * points[:, 0] - sin * points[:, 1]
    states[1:, StateColumn.Y] = ego.y + sin * points[:, 0] + cos * points[:, 1]
    states[1:, StateColumn.YAW] = wrap_pi_array(ego.yaw + points[:, 2])
    states[1:, StateColumn.SPEED] = points[:, 3]
    turn = wrap_pi_array(np.diff(states[:, StateColumn.YAW]))
    states[1:, StateColumn.ACCELERATION] = np.diff(states[:, StateColumn.SPEED]) / dt_s
    states[1:, StateColumn.YAW_RATE] = turn / dt_s
    states[1:, StateColumn.STEERING_ANGLE] = _steering(states, turn, vehicle, dt_s)
    states[1:, StateColumn.STEERING_RATE] = np.diff(states[:, StateColumn.STEERING_ANGLE]) / dt_s
    return states


def _steering(states: Array, turn: Array, vehicle: VehicleParameters,
              dt_s: float) -> Sequence[float]:
    """Return the steering angles (S - 1) for turns of the heading, within the steering rate."""
    angle, angles = float(states[0, StateColumn.STEERING_ANGLE]), []
    speeds = states[:, StateColumn.SPEED]
    for mean, turned in zip((0.5 * (speeds[1:] + speeds[:-1])).tolist(), turn.tolist(),
                            strict=True):
        wanted = angle
        if abs(mean) > _CREEPING:
            wanted = math.atan(vehicle.wheelbase * turned / (mean * dt_s))
        limit = vehicle.max_steering_angle
        wanted = min(max(wanted, -limit), limit)
        angle += dt_s * steering_rate(wanted, angle, dt_s, vehicle.max_steering_rate)
        angles.append(angle)
    return angles


class PedalInverse:
    """
    The inverse of a human's controls: pedals and wheel from acceleration and curvature.

    A motion beyond the range of the controls is approximated. The lag of the powertrain remains.
    """

    def __init__(self, vehicle: VehicleParameters) -> None:
        self._vehicle = vehicle
        self._powertrain = Powertrain(vehicle)
        self._table = load_steering_ratio(vehicle.steering_ratio)

    def command(self, wanted: WantedMotion, speed: float) -> DriverCommand:
        """
        Return the command for a motion, forwards.

        :param speed: present speed [m/s]
        """
        vehicle = self._vehicle
        # Deceleration by drag and rolling resistance alone; none at rest.
        coasting = self._powertrain.command(RELEASED, speed, 1) if speed else 0.0
        force = vehicle.mass * (wanted.acceleration - coasting)
        if force >= 0.0 and not (speed == 0.0 and wanted.acceleration <= 0.0):
            if speed == 0.0:
                force += vehicle.mass * vehicle.gravity * vehicle.rolling_resistance
            share = force / self._powertrain.drive_force_limit(speed)
            throttle, brake = _travel(share, vehicle.throttle_shape), 0.0
        else:
            share = -force / vehicle.max_brake_force if vehicle.max_brake_force else 0.0
            throttle, brake = 0.0, _travel(share, vehicle.brake_shape)
        return DriverCommand(throttle, brake, self._wheel(wanted.curvature, speed))

    def _wheel(self, curvature: float, speed: float) -> float:
        """Return the normalised steering for a curvature."""
        angle, full = math.atan(self._vehicle.wheelbase * curvature), \
            self._vehicle.max_steering_wheel_angle
        turned = 0.0
        for _ in range(_ROUNDS):
            turned = min(full, max(-full, angle * self._table.ratio(speed, turned)))
        return turned / full


def _travel(share: float, shape: float) -> float:
    """Return the pedal's travel in [0, 1] whose response (CRG 20) is a share."""
    if share >= pedal_response(1.0, shape):
        return 1.0
    return -math.log(1.0 - max(share, 0.0)) / shape
