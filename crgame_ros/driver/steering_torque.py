# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The torque that a driver feels at the steering wheel [N m], positive to the left."""

from dataclasses import dataclass
import math

from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.steering import Steering


@dataclass(frozen=True)
class TorqueParameters:
    """
    Steering parameters that are in no vehicle file: those of a typical car with power steering.

    :param contact_half_length: a, of a front tyre's contact patch [m]
    :param slip_stiffness: cornering stiffness by friction and load, C_S of CommonRoad's vehicle
        models, p_ky1 / p_dy1 [1/rad]
    :param caster_trail: distance of the kingpin's axis ahead of the patch's middle [m]
    :param steering_ratio: mechanical ratio of the wheel's angle to the front wheels' [-]
    :param unassisted: share of the torque that power steering leaves to the driver [-]
    :param damping: [N m s/rad]
    :param friction: of the column, at any speed [N m]
    :param scrub: of standing tyres on the road [N m]
    :param scrub_speed: speed at which scrub has fallen to 1/e [m/s]
    :param friction_rate: rate of the wheel over which friction changes its sign [rad/s]
    :param end_stop: stiffness beyond `end_stop_from` [N m/rad]
    :param end_stop_from: share of the wheel's travel to its end [-]
    :param rumble: amplitude off the road, at `rumble_speed` and beyond [N m]
    :param rumble_speed: [m/s]
    :param rumble_hz: its frequency [Hz]
    :param jolt: first amplitude after a collision [N m]
    :param jolt_decay_s: time in which it falls to 1/e [s]
    :param jolt_hz: its frequency [Hz]
    """

    contact_half_length: float = 0.08
    slip_stiffness: float = 20.898
    caster_trail: float = 0.02
    steering_ratio: float = 16.0
    unassisted: float = 0.2
    damping: float = 0.08
    friction: float = 0.15
    scrub: float = 0.9
    scrub_speed: float = 1.0
    friction_rate: float = 0.5
    end_stop: float = 20.0
    end_stop_from: float = 0.97
    rumble: float = 0.7
    rumble_speed: float = 5.0
    rumble_hz: float = 17.0
    jolt: float = 2.5
    jolt_decay_s: float = 0.15
    jolt_hz: float = 23.0


@dataclass(frozen=True)
class WheelMotion:
    """
    The inputs of the torque.

    :param speed: signed, of the rear axle [m/s]
    :param yaw_rate: [rad/s]
    :param wheel_angle: of the steering wheel, positive to the left [rad]
    :param wheel_rate: its rate [rad/s]
    :param time_s: simulation time, on which the rumble depends [s]
    :param off_road: whether the vehicle has left the road.
    :param since_collision_s: time since the last collision, infinite without any [s]
    """

    speed: float
    yaw_rate: float
    wheel_angle: float
    wheel_rate: float = 0.0
    time_s: float = 0.0
    off_road: bool = False
    since_collision_s: float = math.inf


class SteeringTorque:
    """
    Self-aligning torque, damping, friction, end stops, rumble off the road and after a collision.

    The tyres' force and moment are those of the brush model with parabolic pressure (Pacejka,
    Tire and Vehicle Dynamics, section 3.2.1): with a slip s = theta alpha of the front tyres,
    theta = C_S / 3, and lambda = 1 - |s| they are F = mu F_z (1 - lambda^3) and
    M_z = mu F_z a lambda^3 (1 - lambda). The pneumatic trail of a / 3 falls off as the slip grows:
    M_z is largest at 58 % of the grip and zero where the tyre slides; the caster trail's part
    remains. In reverse there is no aligning torque.

    The motion models have no slip. In the linear single-track model
    alpha_f = alpha_r + delta - L (dpsi/dt) / v, where alpha_r is that of a steady turn: it carries
    F = m a l_r / L with a = v dpsi/dt, by the inverted brush model. The other terms are the angle
    by which the driver's wheel leads the vehicle's path.

    :param vehicle: parameters of the vehicle.
    """

    def __init__(self, vehicle: VehicleParameters,
                 parameters: TorqueParameters | None = None) -> None:
        self.parameters = p = parameters or TorqueParameters()
        front = vehicle.rear_to_center / vehicle.wheelbase
        self._wheelbase, self._full_turn = vehicle.wheelbase, vehicle.max_steering_wheel_angle
        self._steering = Steering(vehicle)
        self._mass = vehicle.mass * front
        self._grip = vehicle.friction * self._mass * vehicle.gravity
        self._share = p.unassisted / p.steering_ratio
        self._end = p.end_stop_from * vehicle.max_steering_wheel_angle

    def slip(self, speed: float, yaw_rate: float, wheel_angle: float) -> float:
        """Return theta alpha of the front tyres in forward motion; from 1 on they slide [-]."""
        share = self._mass * speed * yaw_rate / self._grip
        steady = 1.0 - math.cbrt(1.0 - min(abs(share), 1.0))
        angle = self._steering.target_angle(wheel_angle / self._full_turn, speed)
        ahead = angle - math.atan2(self._wheelbase * yaw_rate, speed)
        return math.copysign(steady, share) + self.parameters.slip_stiffness / 3.0 * ahead

    def aligning(self, speed: float, yaw_rate: float, wheel_angle: float) -> float:
        """Return the torque with which the tyres turn the wheel back [N m]."""
        if speed <= 0.0 or self._grip == 0.0:
            return 0.0
        p = self.parameters
        slip = self.slip(speed, yaw_rate, wheel_angle)
        left = max(0.0, 1.0 - abs(slip)) ** 3
        moment = p.contact_half_length * left * min(abs(slip), 1.0) + p.caster_trail * (1.0 - left)
        return -math.copysign(self._grip * moment, slip) * self._share * math.tanh(speed)

    def resistance(self, speed: float, wheel_rate: float) -> float:
        """Return damping and friction, which grow as the vehicle slows down [N m]."""
        p = self.parameters
        friction = p.friction + p.scrub * math.exp(-abs(speed) / p.scrub_speed)
        return -p.damping * wheel_rate - friction * math.tanh(wheel_rate / p.friction_rate)

    def end_stop(self, wheel_angle: float) -> float:
        """Return the torque of the end stops [N m]."""
        beyond = max(0.0, abs(wheel_angle) - self._end)
        return -math.copysign(self.parameters.end_stop * beyond, wheel_angle)

    def shaking(self, motion: WheelMotion) -> float:
        """Return the torque of rumble and jolt [N m]."""
        p = self.parameters
        torque = 0.0
        if motion.off_road:
            torque += p.rumble * min(1.0, abs(motion.speed) / p.rumble_speed) \
                * math.sin(2.0 * math.pi * p.rumble_hz * motion.time_s)
        since = motion.since_collision_s
        if since < 10.0 * p.jolt_decay_s:
            torque += p.jolt * math.exp(-since / p.jolt_decay_s) \
                * math.sin(2.0 * math.pi * p.jolt_hz * since)
        return torque

    def torque(self, motion: WheelMotion) -> float:
        """Return the sum of all torques [N m]."""
        return (self.aligning(motion.speed, motion.yaw_rate, motion.wheel_angle)
                + self.resistance(motion.speed, motion.wheel_rate)
                + self.end_stop(motion.wheel_angle) + self.shaking(motion))
