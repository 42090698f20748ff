# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pure pursuit: steer the arc through a point of the plan ahead (Snider 2009, section 2.2)."""

from math import atan, cos, hypot, sin

from crgame_ros.control.speed import make_speed_controller
from crgame_ros.control.tracker import Control, Reference, Tracker
from crgame_ros.vehicle.control_settings import control_settings, with_options
from crgame_ros.vehicle.models import clipped
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState

WHERE = 'options of tracker pure-pursuit'
# Least ratio of look-ahead distance to offset: an approach of 18 degrees to the path [-].
SHALLOW = 3.0


class PurePursuitTracker(Tracker):
    """
    Pure pursuit: geometric path tracking, CMU-RI-TR-09-08, section 2.2.

    An arc of the rear axle starts along the heading and meets the plan's point at the distance l_d
    and the angle alpha. Its curvature is 2 sin(alpha) / l_d, so that delta = atan(2 L sin(alpha) /
    l_d), with l_d = k v between its bounds. In reverse the point lies behind, and the same arc
    leads to it.

    Beyond the report, because the steering rate is limited and large errors would end in a limit
    cycle: l_d grows with the offset, and the correction of the plan's own curvature is bounded by
    r l_d / (2 v), half of the correction that the rate r can undo within the remaining heading
    error.

    The controller models neither slip nor lag: with FS 2 on a circle of radius R it settles at a
    radius of sqrt(R^2 + l_d^2 (1 / G_s - 1)).

    Options that are None come from `config/control.yaml`.

    :param vehicle: parameters of the vehicle
    :param dt_s: time between calls [s]
    :param look_ahead_time: look-ahead distance over speed, k [s]
    :param shortest_look_ahead: shortest look-ahead distance [m]
    :param longest_look_ahead: longest look-ahead distance [m]
    :param speed_gain: k_v of speed control [1/s]
    :param integral_gain: k_i of speed control [1/s^2]
    :param position_gain: k_s of speed control [1/s]
    :param acceleration_lag: T_a that speed control assumes [s]
    """

    def __init__(
        self, vehicle: VehicleParameters, dt_s: float, look_ahead_time: float | None = None,
        shortest_look_ahead: float | None = None, longest_look_ahead: float | None = None,
        speed_gain: float | None = None, integral_gain: float | None = None,
        position_gain: float | None = None, acceleration_lag: float | None = None,
    ) -> None:
        super().__init__(vehicle, dt_s)
        self.settings = with_options(
            control_settings().pure_pursuit, WHERE, look_ahead_time=look_ahead_time,
            shortest_look_ahead=shortest_look_ahead, longest_look_ahead=longest_look_ahead)
        self._speed = make_speed_controller(
            vehicle, dt_s, WHERE, speed_gain=speed_gain, integral_gain=integral_gain,
            position_gain=position_gain, acceleration_lag=acceleration_lag)

    def reset(self) -> None:
        """Reset the state of earlier tracking."""
        self._speed.reset()

    def control(self, pose: VehicleState, reference: Reference) -> Control:
        """Compute the command of one step."""
        track = reference.track
        position = track.position(pose, reference.since_s)
        distance = hypot(self.look_ahead(pose.speed), SHALLOW * position.lateral)
        x, y = track.ahead(pose, position.time_s, distance)
        # Only the correction is limited, never the steering that the path needs.
        planned = atan(self.vehicle.wheelbase * track.curvature(position.time_s))
        limit = self.vehicle.max_steering_rate * distance / (2.0 * max(abs(pose.speed), 0.1))
        correction = steering_angle_to(pose, x, y, self.vehicle.wheelbase) - planned
        angle = clipped(planned + clipped(correction, limit), self.vehicle.max_steering_angle)
        return Control(angle, self._speed.command(pose, reference, position.s))

    def look_ahead(self, speed: float) -> float:
        """Return the look-ahead distance l_d at a speed [m]."""
        settings = self.settings
        return min(settings.longest_look_ahead, max(
            settings.shortest_look_ahead, settings.look_ahead_time * abs(speed)))


def steering_angle_to(pose: VehicleState, x: float, y: float, wheelbase: float) -> float:
    """
    Find the steering angle of the arc through a point, atan(2 L sin(alpha) / l_d).

    :param x: the point [m]
    :param y: the point [m]
    :param wheelbase: L [m]
    :return: [rad]
    """
    dx, dy = x - pose.x, y - pose.y
    square = dx * dx + dy * dy
    if square == 0.0:
        return 0.0
    # sin(alpha) is the point's lateral offset over l_d.
    lateral = dy * cos(pose.yaw) - dx * sin(pose.yaw)
    return atan(2.0 * wheelbase * lateral / square)
