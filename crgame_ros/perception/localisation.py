# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Imperfect localisation: biased white noise on the truth, and an extended Kalman filter (FS II-B1).

The filter's states are x, y, yaw and v of the rear axle. It predicts by the kinematic model

    x' = v cos(yaw),  y' = v sin(yaw),  yaw' = w,  v' = a

An inertial unit measures its inputs, the changes of heading and speed since the last step, with
white noise. Measurements of all four states correct the filter (Thrun, Burgard, Fox: Probabilistic
Robotics, 2005, table 3.3). Its noise covariances are those of the noise that is injected.
"""

import math

from crgame_ros.game.perception_spec import LocalisationSpec
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.perception.noise import in_map, KeyedNoise
from crgame_ros.vehicle.state import ENCODER_REST, VehicleState
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STATES = 4
# The noise of at most this many steps is summed at once.
MOST_STEPS = 1000
# Columns of a step's row of random numbers.
_HEADING, _SPEED_CHANGE, _WALK, _MEASUREMENT, _WIDTH = 0, 1, 2, 4, 8


class Localisation:
    """
    The estimated state of an AV, in simulation coordinates.

    It begins with the measurement of step n. Steering angle, acceleration, yaw rate and steering
    rate of the estimate are the true ones, from the vehicle's own sensors, because they do not
    depend on localisation. Steps may be left out; the inertial unit then measures the change since
    the last one.

    :param spec: noise, bias and rates
    :param name: of the vehicle, so that its noise is independent
    :param initial: true state at step n
    :param dt_s: simulation step [s]
    :param n: step at which it begins
    """

    def __init__(self, spec: LocalisationSpec, seed: int, name: str, initial: VehicleState,
                 dt_s: float, n: int = 0) -> None:
        self._spec = spec
        self._dt_s = dt_s
        self._noise = KeyedNoise(seed, f'{name}/localisation', _WIDTH)
        self._period = max(1, round(1.0 / (spec.rate * dt_s)))
        self._lost_probability = min(1.0, spec.dropout_rate * dt_s)
        self._lost_steps = round(spec.dropout_duration / dt_s)
        self._lost_until = n
        self._n = n
        self._truth = initial
        # The bias walks along the axes that the vehicle had at first: those of later steps are not
        # known of steps that are left out.
        self._walk: Array = np.zeros(2)
        self._first_yaw = initial.yaw
        deviations = self._deviations(initial)
        self._covariance: Array = np.diag(np.square(deviations))
        self._state: Array = self._measurement(n, initial, deviations)
        self._jacobian: Array = np.eye(STATES)
        self._input: Array = np.zeros((STATES, 2))
        self._input[2, 0] = self._input[3, 1] = 1.0

    @property
    def estimate(self) -> VehicleState:
        """
        Return the vehicle's state as estimated by the filter.

        Its speed never has the wrong sign, because the gear is known.
        """
        x, y, yaw, speed = self._state.tolist()
        truth = self._truth
        speed = max(speed, 0.0) if truth.speed >= 0.0 else min(speed, 0.0)
        return truth._replace(x=x, y=y, yaw=yaw, speed=speed)

    @property
    def covariance(self) -> Array:
        """Return the covariance of the estimated x, y [m], yaw [rad], speed [m/s]; (4, 4)."""
        return self._covariance.copy()

    @property
    def lost(self) -> bool:
        """Return whether the pose is not measured at present."""
        return self._n < self._lost_until

    def step(self, n: int, truth: VehicleState) -> None:
        """
        Update the estimate with a step; ignore steps up to the last one.

        :param truth: the true state at n
        """
        if n <= self._n:
            return
        rows = self._summed_noise(n)
        self._find_dropouts(n)
        self._predict(n - self._n, truth, rows)
        self._walk += self._spec.bias_walk * math.sqrt(self._dt_s) * rows[_WALK:_WALK + 2]
        self._n = n
        self._truth = truth
        if n % self._period == 0:
            self._correct(n, truth)

    def _summed_noise(self, n: int) -> Array:
        """Return the sum of the noise of all steps after the last one, up to n."""
        steps = n - self._n
        latest = range(n + 1 - min(steps, MOST_STEPS), n + 1)
        # A stamp far ahead must not cost time: the noise of the latest steps stands for all.
        return np.sum([self._noise.normal(step) for step in latest], axis=0) \
            * math.sqrt(steps / len(latest))

    def _predict(self, steps: int, truth: VehicleState, rows: Array) -> None:
        """Predict the estimate by the inertial unit's measurements; sum up their noise."""
        spec, before, time_s = self._spec, self._truth, steps * self._dt_s
        unit = math.sqrt(self._dt_s)
        turn = wrap_pi(truth.yaw - before.yaw) + spec.yaw_rate_noise * unit * rows[_HEADING]
        faster = truth.speed - before.speed \
            + spec.acceleration_noise * unit * rows[_SPEED_CHANGE]
        x, y, yaw, speed = self._state.tolist()
        middle, mean = yaw + 0.5 * turn, speed + 0.5 * faster
        cos, sin = time_s * math.cos(middle), time_s * math.sin(middle)
        self._state[:] = (x + mean * cos, y + mean * sin, wrap_pi(yaw + turn), speed + faster)
        jacobian, gain = self._jacobian, self._input
        jacobian[0, 2], jacobian[0, 3] = -mean * sin, cos
        jacobian[1, 2], jacobian[1, 3] = mean * cos, sin
        gain[:2] = 0.5 * jacobian[:2, 2:]
        scaled = gain * (math.sqrt(time_s) * np.array(
            (spec.yaw_rate_noise, spec.acceleration_noise)))
        covariance = jacobian @ self._covariance @ jacobian.T + scaled @ scaled.T
        covariance[0, 0] += spec.motion_noise ** 2 * time_s
        covariance[1, 1] += spec.motion_noise ** 2 * time_s
        self._covariance = 0.5 * (covariance + covariance.T)

    def _correct(self, n: int, truth: VehicleState) -> None:
        """Correct by a measurement of pose and speed; in a dropout, of the speed alone."""
        deviations = self._deviations(truth)
        measured = slice(3, STATES) if self.lost else slice(0, STATES)
        innovation = self._measurement(n, truth, deviations) - self._state
        innovation[2] = wrap_pi(innovation[2])
        noise = np.diag(np.square(deviations[measured]))
        covariance = self._covariance
        gain = np.linalg.solve(covariance[measured, measured] + noise, covariance[measured]).T
        self._state += gain @ innovation[measured]
        self._state[2] = wrap_pi(float(self._state[2]))
        # Joseph's form stays positive definite in spite of rounding.
        remaining = np.eye(STATES)
        remaining[:, measured] -= gain
        covariance = remaining @ covariance @ remaining.T + gain @ noise @ gain.T
        self._covariance = 0.5 * (covariance + covariance.T)

    def _deviations(self, truth: VehicleState) -> Array:
        """Return the standard deviations (4) of a measurement of x, y, yaw and speed."""
        spec = self._spec
        speed = min(spec.speed_noise, ENCODER_REST) if abs(truth.speed) < ENCODER_REST \
            else spec.speed_noise
        return np.array((spec.position_noise, spec.position_noise, spec.yaw_noise, speed))

    def _measurement(self, n: int, truth: VehicleState, deviations: Array) -> Array:
        """Measure x, y, yaw and speed (4): the truth with bias and noise."""
        spec = self._spec
        bias_x, bias_y = spec.position_bias
        walked_x, walked_y = in_map(self._walk, self._first_yaw)
        biased = np.array((truth.x + bias_x + walked_x, truth.y + bias_y + walked_y,
                           truth.yaw + spec.yaw_bias, truth.speed))
        errors = deviations * self._noise.normal(n)[_MEASUREMENT:]
        errors[:2] = in_map(errors[:2], truth.yaw)
        measured: Array = biased + errors
        measured[2] = wrap_pi(float(measured[2]))
        return measured

    def _find_dropouts(self, n: int) -> None:
        """Find the dropouts that begin in the steps up to n, including steps left out."""
        if not self._lost_probability:
            return
        for step in range(max(self._n + 1, n - self._lost_steps), n + 1):
            if self._noise.uniform(step) < self._lost_probability:
                self._lost_until = step + self._lost_steps
