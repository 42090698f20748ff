# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The dynamic bicycle model of FS equation 2: slip, and lags of steering and acceleration."""

from math import cos, exp, sin, tan

from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.vehicle.control_settings import control_settings, with_options
from crgame_ros.vehicle.models import clipped, VehicleModel
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState


class DynamicBicycle(VehicleModel):
    """
    The dynamic bicycle of FS equation 2: slip, and delays of steering and acceleration.

    States: rear-axle position x, y [m], heading theta [rad], steering angle delta [rad], speed v
    [m/s], acceleration a [m/s^2]. Inputs: commanded steering angle delta_c and acceleration a_c,
    constant over a step. Continuous dynamics: x' = v cos(theta), y' = v sin(theta),
    theta' = G_s v / L tan(delta), delta' = (delta_c - delta) / T_delta, v' = a,
    a' = (a_c - a) / T_a. Beyond the paper: the steering rate is limited to the vehicle's limit,
    and braking ends in a stop.

    Discretisation: delta, a and v are exact, because their equations are linear and independent;
    theta, x and y follow by Simpson's rule, which is of fourth order.

    Options that are None come from `config/control.yaml`.

    :param vehicle: parameters of the vehicle
    :param slip: gain G_s of the yaw rate in [0, 1], 1 without slip [-]
    :param steering_lag: time constant T_delta of the steering angle [s]
    :param acceleration_lag: time constant T_a of the acceleration [s]
    """

    def __init__(self, vehicle: VehicleParameters, slip: float | None = None,
                 steering_lag: float | None = None,
                 acceleration_lag: float | None = None) -> None:
        super().__init__(vehicle)
        self.settings = with_options(
            control_settings().dynamic_bicycle, 'options of vehicle model dynamic-bicycle',
            slip=slip, steering_lag=steering_lag, acceleration_lag=acceleration_lag)
        self._turning = self.settings.slip / vehicle.wheelbase

    def step(self, state: VehicleState, steering_angle_command: float,
             acceleration_command: float, dt_s: float) -> VehicleState:
        """Advance by one step, in which the vehicle may come to rest."""
        vehicle, speed = self.vehicle, state.speed
        target = clipped(steering_angle_command, vehicle.max_steering_angle)
        commanded = clipped(acceleration_command, vehicle.max_acceleration)
        direction = self.direction(speed)
        start, angle_start = state.acceleration, state.steering_angle
        angle = self._angle(angle_start, target, dt_s)
        rate = (angle - angle_start) / dt_s
        if speed == 0.0:
            if direction * commanded <= 0.0:
                return VehicleState(state.x, state.y, state.yaw, 0.0, angle, 0.0, 0.0, rate)
            start = direction * max(0.0, direction * start)
        moving_s, end_speed, end = dt_s, *self._speed(speed, start, commanded, dt_s)
        # Above its greatest speed the car may roll on, but not accelerate.
        limit = max(self.speed_limit(direction), direction * speed)
        if direction * end_speed > limit:
            end_speed, end = direction * limit, 0.0
        elif direction * end_speed < 0.0:
            moving_s = self._stop_after(speed, start, commanded, dt_s)
            end_speed, end = 0.0, 0.0
        half = 0.5 * moving_s
        middle = direction * min(limit, max(
            0.0, direction * self._speed(speed, start, commanded, half)[0]))
        x, y, yaw = self._moved(
            state, (speed, middle, end_speed),
            (angle_start, self._angle(angle_start, target, half),
             angle if moving_s == dt_s else self._angle(angle_start, target, moving_s)), moving_s)
        return VehicleState(x, y, wrap_pi(yaw), end_speed, angle, end,
                            self._turning * end_speed * tan(angle), rate)

    def _angle(self, start: float, target: float, time_s: float) -> float:
        """Return the steering angle after a time: at the rate limit first, then exponentially."""
        lag, limit = self.settings.steering_lag, self.vehicle.max_steering_rate
        error = target - start
        excess = abs(error) - limit * lag
        if excess > 0.0:
            limited_s = excess / limit
            rate = limit if error > 0.0 else -limit
            if time_s <= limited_s:
                return start + rate * time_s
            error, time_s = rate * lag, time_s - limited_s
        return target - error * exp(-time_s / lag)

    def _speed(self, speed: float, acceleration: float, commanded: float,
               time_s: float) -> tuple[float, float]:
        """Return speed and acceleration after a time, for any signs."""
        lag = self.settings.acceleration_lag
        decay = exp(-time_s / lag)
        difference = acceleration - commanded
        return (speed + commanded * time_s + difference * lag * (1.0 - decay),
                commanded + difference * decay)

    def _stop_after(self, speed: float, acceleration: float, commanded: float,
                    time_s: float) -> float:
        """Return when the speed passes zero before a time, by bisection to its 1e-15th part."""
        # To import scipy.optimize takes a tenth of the start of a run.
        low, high = 0.0, time_s
        for _ in range(50):
            middle = 0.5 * (low + high)
            if speed * self._speed(speed, acceleration, commanded, middle)[0] > 0.0:
                low = middle
            else:
                high = middle
        return high

    def _moved(self, state: VehicleState, speeds: tuple[float, float, float],
               angles: tuple[float, float, float], time_s: float) -> tuple[float, float, float]:
        """Return the pose, integrated over speeds and steering angles at start, middle and end."""
        yaw, turning = state.yaw, self._turning
        first, middle, last = (turning * v * tan(delta)
                               for v, delta in zip(speeds, angles, strict=True))
        # The parabola through the three yaw rates, integrated over the first half and the whole.
        half_yaw = yaw + time_s / 24.0 * (5.0 * first + 8.0 * middle - last)
        end_yaw = yaw + time_s / 6.0 * (first + 4.0 * middle + last)
        sixth = time_s / 6.0
        return (
            state.x + sixth * (speeds[0] * cos(yaw) + 4.0 * speeds[1] * cos(half_yaw)
                               + speeds[2] * cos(end_yaw)),
            state.y + sixth * (speeds[0] * sin(yaw) + 4.0 * speeds[1] * sin(half_yaw)
                               + speeds[2] * sin(end_yaw)),
            end_yaw)
