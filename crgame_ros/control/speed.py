# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Speed control along a plan: feed-forward and PI between stops, a separate law into each stop."""

from math import exp

from crgame_ros.control.tracker import Reference
from crgame_ros.vehicle.control_settings import control_settings, SpeedSettings, with_options
from crgame_ros.vehicle.models import clipped
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import STANDING, VehicleState

# The stopping law takes over this many acceleration lags before the stop.
STOPPING_LAGS = 2.0
# Within this distance a stop counts as reached [m].
STOP_TOLERANCE = 0.005
# Braking that holds a vehicle that has nearly stopped, as it should [m/s^2].
HOLDING_DECELERATION = 1.0
# A faster backward motion is braked; a slower one is noise of the estimate [m/s].
ROLLING_BACK = 0.15
# Beyond the stop's place the vehicle brakes at least this hard [m/s^2], to stop within this
# distance [m].
FIRM_DECELERATION = 4.0
OVERRUN = 0.25


class SpeedController:
    """
    The controller of the acceleration that keeps a vehicle at its planned place and speed.

    Between stops, along the direction of travel: v_t = v_ref + k_s (s_ref - s) and
    a_c = a_ref(t + T_a) + k_v (v_t - v) + k_i integral(v_t - v) dt. The planned acceleration is
    that of T_a ahead, because the vehicle reacts with that lag. The integral is bounded, and is
    held while the command is at a limit and the error would push it further (anti-windup). With d
    left to a stop, the vehicle brakes harder by at least the difference of v^2 / (2 d) and the
    plan's v_ref^2 / (2 d_ref).

    A proportional law would creep into a stop. There the target acceleration is the constant one
    that ends at its place, n = -v^2 / (2 d). With the lag a' = (a_c - a) / T_a, where a is
    computed from past commands, n' = (n - a) v / d, so that with a_c = n + T_a (v / d) (n - a) the
    difference n - a decays with T_a at any remaining distance.

    :param vehicle: parameters of the vehicle
    :param dt_s: time between calls [s]
    :param settings: the gains
    :param acceleration_lag: T_a that the controller assumes [s]
    """

    def __init__(self, vehicle: VehicleParameters, dt_s: float, settings: SpeedSettings,
                 acceleration_lag: float) -> None:
        self._limit = vehicle.max_acceleration
        self._dt_s = dt_s
        self._settings = settings
        self._lag = acceleration_lag
        self._answer = 1.0 - exp(-dt_s / acceleration_lag)
        self.reset()

    def reset(self) -> None:
        """Reset the integral and the expected acceleration."""
        self._integral = 0.0
        self._expected: float | None = None
        self._rolls_back = False

    def command(self, pose: VehicleState, reference: Reference, s: float) -> float:
        """
        Compute the commanded acceleration of one step.

        :param pose: the state that the controller believes
        :param reference: the plan
        :param s: arc length of the pose along the plan [m]
        :return: signed along the heading, within the vehicle's limits [m/s^2]
        """
        track, now_s = reference.track, reference.since_s
        direction = track.direction(now_s)
        expected = pose.acceleration if self._expected is None else self._expected
        speed = direction * pose.speed
        stop = track.next_stop(now_s)
        if stop is not None and now_s >= stop[0] - STOPPING_LAGS * self._lag:
            self._integral = 0.0
            wanted = self._stopping(speed, direction * expected, stop[1] - s)
        else:
            wanted = self._following(speed, direction, reference, s,
                                     None if stop is None else stop[1])
        command = direction * clipped(wanted, self._limit)
        # At rest the brakes hold the vehicle, and the lag starts afresh.
        expected = 0.0 if pose.speed == 0.0 and wanted <= 0.0 else expected
        self._expected = expected + self._answer * (command - expected)
        return command

    def _following(self, speed: float, direction: float, reference: Reference, s: float,
                   stop_s: float | None) -> float:
        settings, track = self._settings, reference.track
        planned = track.at(reference.since_s)
        planned_speed = direction * planned.speed
        forward = direction * track.at(reference.since_s + self._lag).acceleration
        target = max(0.0, planned_speed + settings.position_gain * (planned.s - s))
        error = target - speed
        grown = clipped(self._integral + settings.integral_gain * error * self._dt_s,
                        settings.integral_limit)
        correction = settings.speed_gain * error + grown
        cut = clipped(correction, settings.correction_limit)
        if stop_s is not None and stop_s > planned.s:
            harder = _needed(speed, stop_s - s) - _needed(planned_speed, stop_s - planned.s)
            cut = min(cut, harder) if harder < 0.0 else cut
        wanted = forward + cut
        limited = cut != correction or abs(wanted) > self._limit
        if not (limited and error * correction > 0.0):
            self._integral = grown
        return wanted

    def _stopping(self, speed: float, acceleration: float, way: float) -> float:
        """Return the braking into a stop; never a push, as an estimated speed is not exactly 0."""
        self._rolls_back = speed < -ROLLING_BACK or (self._rolls_back and speed < 0.0)
        if self._rolls_back:
            return FIRM_DECELERATION
        if speed <= STANDING:
            return -HOLDING_DECELERATION if speed > 0.0 else 0.0
        needed = _needed(speed, way)
        if way <= STOP_TOLERANCE:
            return needed
        return min(0.0, needed + self._lag * speed / way * (needed - acceleration))


def _needed(speed: float, way: float) -> float:
    """Return the constant acceleration that ends at rest after a distance [m/s^2]."""
    if way > STOP_TOLERANCE:
        return -0.5 * speed * speed / way
    return -max(FIRM_DECELERATION, 0.5 * speed * speed / OVERRUN)


def make_speed_controller(
    vehicle: VehicleParameters, dt_s: float, where: str, *, speed_gain: float | None,
    integral_gain: float | None, position_gain: float | None, acceleration_lag: float | None,
) -> SpeedController:
    """
    Create a speed controller from a tracker's options; None is the value of `config/control.yaml`.

    :param where: the tracker, for messages
    :raises InputError: if an option is out of bounds.
    """
    settings = with_options(
        control_settings().speed_control, where, speed_gain=speed_gain,
        integral_gain=integral_gain, position_gain=position_gain)
    lags = with_options(
        control_settings().dynamic_bicycle, where, acceleration_lag=acceleration_lag)
    return SpeedController(vehicle, dt_s, settings, lags.acceleration_lag)
