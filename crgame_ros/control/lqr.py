# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Optimal lateral control with curvature feed-forward (Snider 2009, chapter 4), for FS 2."""

from bisect import bisect_right
import functools
from math import atan

from crgame_ros.control.speed import make_speed_controller
from crgame_ros.control.tracker import Control, Reference, Tracker
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.vehicle.control_settings import (
    control_settings,
    DynamicBicycleSettings,
    LqrSettings,
    with_options,
)
from crgame_ros.vehicle.models import clipped
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import REST, VehicleState
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are

Array = NDArray[np.float64]
WHERE = 'options of tracker lqr'
# Speeds of the gain table [m/s]; linear between them, held beyond.
TABLE_SPEEDS = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.5, 15.0, 17.5, 20.0, 25.0,
                30.0, 35.0, 40.0, 45.0, 50.0, 60.0)
# Largest angle of approach to the path, however large the offset [rad].
LARGEST_APPROACH = 0.3


class LqrTracker(Tracker):
    """
    The linear quadratic regulator on the lateral error of FS equation 2.

    Snider's error model has tyre forces; FS 2 has slip and a steering lag instead, so that the
    errors against the plan are the offset e (left of the path), the heading error psi and the
    steering angle's deviation d = delta - delta_ref from the one that the plan's curvature kappa
    needs, delta_ref = atan(L kappa / G_s). Linearised at the speed v:

        e' = v psi,  psi' = (G_s v / L) d,  d' = (u - d) / T_delta

    with the input u = delta_c - delta_c,ref. The feed-forward
    delta_c,ref = delta_ref + T_delta delta_ref' is delta_ref one lag ahead. Discretised
    exactly for a held input, u = -K(v) (e, psi, d) minimises the sum of
    (e / lateral_error)^2 + (psi / heading_error)^2 + (u / u_max)^2, where u_max is the smaller of
    `steering_correction` and the angle whose lateral acceleration at v is `correction`. K comes
    from the discrete Riccati equation for each speed of a table. In reverse the same equations
    hold for |v| and -psi in place of v and psi.

    Options that are None come from `config/control.yaml`.

    :param vehicle: parameters of the vehicle
    :param dt_s: time between calls [s]
    :param lateral_error: offset that costs 1 [m]
    :param heading_error: heading error that costs 1 [rad]
    :param correction: lateral acceleration of a steering correction that costs 1 [m/s^2]
    :param steering_correction: steering correction that costs 1 at low speed [rad]
    :param feed_forward: steer the plan's curvature ahead of any error
    :param slip: G_s that the controller assumes [-]
    :param steering_lag: T_delta that the controller assumes [s]
    :param speed_gain: k_v of speed control [1/s]
    :param integral_gain: k_i of speed control [1/s^2]
    :param position_gain: k_s of speed control [1/s]
    :param acceleration_lag: T_a that speed control assumes [s]
    """

    def __init__(
        self, vehicle: VehicleParameters, dt_s: float, lateral_error: float | None = None,
        heading_error: float | None = None, correction: float | None = None,
        steering_correction: float | None = None, feed_forward: bool | None = None,
        slip: float | None = None, steering_lag: float | None = None,
        speed_gain: float | None = None, integral_gain: float | None = None,
        position_gain: float | None = None, acceleration_lag: float | None = None,
    ) -> None:
        super().__init__(vehicle, dt_s)
        self.settings = with_options(
            control_settings().lqr, WHERE, lateral_error=lateral_error,
            heading_error=heading_error, correction=correction,
            steering_correction=steering_correction, feed_forward=feed_forward)
        self.dynamics = with_options(
            control_settings().dynamic_bicycle, WHERE, slip=slip, steering_lag=steering_lag)
        self._speed = make_speed_controller(
            vehicle, dt_s, WHERE, speed_gain=speed_gain, integral_gain=integral_gain,
            position_gain=position_gain, acceleration_lag=acceleration_lag)
        self._gains = gain_table(vehicle.wheelbase, dt_s, self.settings, self.dynamics)

    def reset(self) -> None:
        """Reset the state of earlier tracking."""
        self._speed.reset()

    def control(self, pose: VehicleState, reference: Reference) -> Control:
        """Compute the command of one step."""
        track = reference.track
        position = track.position(pose, reference.since_s)
        acceleration = self._speed.command(pose, reference, position.s)
        # At the end of its plan, a standing vehicle does not turn its wheels.
        if abs(pose.speed) < REST and not track.moves_after(reference.since_s):
            return Control(pose.steering_angle, acceleration)
        forward = deviation_from = 0.0
        if self.settings.feed_forward:
            deviation_from = self._steady_angle(track.curvature(position.time_s))
            forward = self._steady_angle(
                track.curvature(position.time_s + self.dynamics.steering_lag))
        direction = track.direction(reference.since_s)
        offset_gain, heading_gain, steering_gain = self.gain(pose.speed)
        approach = clipped(offset_gain * position.lateral, LARGEST_APPROACH * heading_gain)
        correction = -approach \
            - direction * heading_gain * wrap_pi(pose.yaw - position.yaw) \
            - steering_gain * (pose.steering_angle - deviation_from)
        limit = self.largest_correction(pose.speed)
        return Control(clipped(forward + clipped(correction, limit),
                               self.vehicle.max_steering_angle), acceleration)

    def largest_correction(self, speed: float) -> float:
        """
        Return the bound of the feedback [rad] that the limited steering rate can undo in time.

        Large errors would otherwise end in a limit cycle. Turning the wheels back from delta at
        the rate r takes delta / r, in which the heading goes on by v delta^2 / (2 r L). The
        feedback begins to do so at a heading error of (1 + K_d) delta / K_psi, which is twice the
        needed one for delta = r L (1 + K_d) / (v K_psi).
        """
        _, heading_gain, steering_gain = self.gain(speed)
        return self.vehicle.max_steering_rate * self.vehicle.wheelbase * (1.0 + steering_gain) \
            / (max(abs(speed), TABLE_SPEEDS[0]) * heading_gain)

    def gain(self, speed: float) -> tuple[float, float, float]:
        """Return K at a speed: for e [rad/m], psi [-] and d [-]."""
        magnitude = min(max(abs(speed), TABLE_SPEEDS[0]), TABLE_SPEEDS[-1])
        i = min(bisect_right(TABLE_SPEEDS, magnitude), len(TABLE_SPEEDS) - 1) - 1
        f = (magnitude - TABLE_SPEEDS[i]) / (TABLE_SPEEDS[i + 1] - TABLE_SPEEDS[i])
        (a, b, c), (d, e, g) = self._gains[i], self._gains[i + 1]
        return a + f * (d - a), b + f * (e - b), c + f * (g - c)

    def _steady_angle(self, curvature: float) -> float:
        # Without grip (G_s = 0) no steering angle curves the path.
        slip = max(self.dynamics.slip, 1e-3)
        return clipped(atan(self.vehicle.wheelbase * curvature / slip),
                       self.vehicle.max_steering_angle)


def error_model(speed: float, wheelbase: float, dt_s: float,
                dynamics: DynamicBicycleSettings) -> tuple[Array, Array]:
    """
    Discretise the error model exactly for an input that is held over a step.

    :param speed: absolute speed [m/s]
    :param wheelbase: L [m]
    :return: A (3, 3) and B (3, 1) for e [m], psi [rad] and d [rad]
    """
    lag = dynamics.steering_lag
    system = np.zeros((4, 4))
    system[0, 1] = speed
    system[1, 2] = dynamics.slip * speed / wheelbase
    system[2, 2:] = -1.0 / lag, 1.0 / lag
    held = expm(system * dt_s)
    return held[:3, :3], held[:3, 3:]


def weights(speed: float, wheelbase: float, settings: LqrSettings) -> tuple[Array, Array]:
    """
    Return the weights by Bryson's rule.

    :return: Q (3, 3) and R (1, 1)
    """
    largest = min(settings.steering_correction,
                  atan(settings.correction * wheelbase / speed ** 2))
    return (np.diag((settings.lateral_error ** -2, settings.heading_error ** -2, 0.0)),
            np.array(((largest ** -2,),)))


@functools.cache
def gain_table(wheelbase: float, dt_s: float, settings: LqrSettings,
               dynamics: DynamicBicycleSettings) -> tuple[tuple[float, float, float], ...]:
    """
    Solve the discrete Riccati equation at each speed of the table.

    :return: K for each of `TABLE_SPEEDS`: for e [rad/m], psi [-] and d [-]
    """
    rows = []
    for speed in TABLE_SPEEDS:
        a, b = error_model(speed, wheelbase, dt_s, dynamics)
        q, r = weights(speed, wheelbase, settings)
        p = solve_discrete_are(a, b, q, r)
        offset, heading, steering = np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a)[0].tolist()
        rows.append((offset, heading, steering))
    return tuple(rows)
