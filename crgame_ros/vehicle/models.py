# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Models of a vehicle's motion under commands of steering angle and acceleration."""

from abc import ABC, abstractmethod
from math import copysign, cos, sin, tan

from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.registry import ModelRegistry
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.powertrain import Powertrain
from crgame_ros.vehicle.state import VehicleState
from crgame_ros.vehicle.steering import steering_rate


class VehicleModel(ABC):
    """
    The motion of one vehicle under commanded steering angle and acceleration.

    Commands beyond the vehicle's limits are limited to them. Reverse is a gear: the speed never
    changes its sign within a step, a command against the direction of motion brakes, and at rest
    only a command in the gear's direction starts a motion.

    :param vehicle: parameters of the vehicle
    """

    def __init__(self, vehicle: VehicleParameters) -> None:
        self.vehicle = vehicle
        # 1 forward, -1 reverse; it matters at rest only.
        self.gear = 1

    @abstractmethod
    def step(self, state: VehicleState, steering_angle_command: float,
             acceleration_command: float, dt_s: float) -> VehicleState:
        """
        Advance by one step.

        :param state: rear axle
        :param steering_angle_command: front wheels, positive to the left [rad]
        :param acceleration_command: signed along the heading [m/s^2]
        :param dt_s: greater than 0 [s]
        :return: the new state, rear axle
        """

    def direction(self, speed: float) -> float:
        """Return the direction of travel, 1 or -1: that of the motion, or at rest of the gear."""
        return copysign(1.0, speed) if speed != 0.0 else float(self.gear)

    def speed_limit(self, direction: float) -> float:
        """Return the largest absolute speed in a direction of travel [m/s]."""
        return self.vehicle.max_speed if direction > 0.0 else self.vehicle.max_reverse_speed


class KinematicSingleTrack(VehicleModel):
    """
    The kinematic single-track model of CRG equations 2-4.

    The commanded steering angle is reached as fast as the vehicle's steering rate allows. The
    commanded acceleration is reached at once.

    :param vehicle: parameters of the vehicle
    :param powertrain_lag: whether the acceleration lags as in CRG 25 instead, by the vehicle's
        `longitudinal_lag`
    """

    def __init__(self, vehicle: VehicleParameters, powertrain_lag: bool = False) -> None:
        super().__init__(vehicle)
        self._powertrain = Powertrain(vehicle) if powertrain_lag else None

    def step(self, state: VehicleState, steering_angle_command: float,
             acceleration_command: float, dt_s: float) -> VehicleState:
        """Advance by one Runge-Kutta step; a stop within it is found in closed form."""
        vehicle, speed = self.vehicle, state.speed
        direction = self.direction(speed)
        commanded = clipped(acceleration_command, vehicle.max_acceleration)
        if speed == 0.0 and direction * commanded <= 0.0:
            acceleration = 0.0
        elif self._powertrain is None:
            acceleration = commanded
        else:
            acceleration = self._powertrain.lag(state.acceleration, commanded, dt_s)
        target = clipped(steering_angle_command, vehicle.max_steering_angle)
        rate = steering_rate(target, state.steering_angle, dt_s, vehicle.max_steering_rate)
        driven_s, acceleration = self._within_speed_limits(speed, acceleration, direction, dt_s)
        x, y, yaw, new_speed, angle = integrate(
            state.x, state.y, state.yaw, speed, state.steering_angle,
            acceleration, rate, vehicle.wheelbase, driven_s)
        # A stop at the very end of the step may leave a rounding error below zero.
        if driven_s < dt_s or direction * new_speed < 0.0:
            new_speed, acceleration = 0.0, 0.0
            angle += rate * (dt_s - driven_s)
        return VehicleState(
            x, y, wrap_pi(yaw), new_speed, angle, acceleration,
            new_speed * tan(angle) / vehicle.wheelbase, rate)

    def _within_speed_limits(
        self, speed: float, acceleration: float, direction: float, dt_s: float,
    ) -> tuple[float, float]:
        """Return how long the car moves within the step [s], and its acceleration."""
        along = direction * speed
        along_acceleration = direction * acceleration
        end = along + along_acceleration * dt_s
        if end <= 0.0 and along_acceleration < 0.0:
            return min(dt_s, along / -along_acceleration), acceleration
        # Above its greatest speed the car may roll on, but not accelerate.
        limit = max(self.speed_limit(direction), along)
        if end > limit:
            return dt_s, direction * (limit - along) / dt_s
        return dt_s, acceleration


def clipped(value: float, limit: float) -> float:
    """Return a value limited to [-limit, limit]."""
    return min(limit, max(-limit, value))


VEHICLE_MODELS = ModelRegistry(
    'vehicle_models', 'vehicle model',
    {'ks': 'crgame_ros.vehicle.models:KinematicSingleTrack',
     'dynamic-bicycle': 'crgame_ros.vehicle.dynamic_bicycle:DynamicBicycle'},
    VehicleModel, 'docs/control.md', ('vehicle',), 'in config/control.yaml')


def integrate(
    x: float, y: float, yaw: float, speed: float, steering_angle: float,
    acceleration: float, steering_rate: float, wheelbase: float, dt_s: float,
) -> tuple[float, float, float, float, float]:
    """
    Advance the KS model by one classical Runge-Kutta step (CRG 2-4).

    States: rear-axle position x, y [m], heading [rad], signed speed v [m/s], front-wheel steering
    angle delta [rad]. Inputs: acceleration a [m/s^2] and steering rate [rad/s], constant over the
    step. Continuous dynamics: x' = v cos(yaw), y' = v sin(yaw), yaw' = v tan(delta) / L, v' = a,
    delta' = steering rate. Speed and steering angle are linear over the step, so that two of the
    four slopes coincide. The step below equals the textbook's with fewer evaluations.

    :param wheelbase: L [m]
    :param dt_s: length of the step [s]
    :return: x, y, yaw, speed, steering angle after the step; the yaw is not normalised.
    """
    half = 0.5 * dt_s
    middle_speed = speed + half * acceleration
    end_speed = speed + dt_s * acceleration
    end_steering = steering_angle + dt_s * steering_rate
    yaw_rate_1 = speed * tan(steering_angle) / wheelbase
    yaw_rate_2 = middle_speed * tan(steering_angle + half * steering_rate) / wheelbase
    yaw_rate_4 = end_speed * tan(end_steering) / wheelbase
    yaw_2 = yaw + half * yaw_rate_1
    yaw_3 = yaw + half * yaw_rate_2
    yaw_4 = yaw + dt_s * yaw_rate_2
    sixth = dt_s / 6.0
    return (
        x + sixth * (speed * cos(yaw) + 2.0 * middle_speed * (cos(yaw_2) + cos(yaw_3))
                     + end_speed * cos(yaw_4)),
        y + sixth * (speed * sin(yaw) + 2.0 * middle_speed * (sin(yaw_2) + sin(yaw_3))
                     + end_speed * sin(yaw_4)),
        yaw + sixth * (yaw_rate_1 + 4.0 * yaw_rate_2 + yaw_rate_4),
        end_speed,
        end_steering,
    )
