# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Force feedback: the force of a wheel's motor over time, from the vehicle's motion."""

from dataclasses import dataclass
import math
from typing import Protocol

from crgame_ros.driver.device_map import ForceLimits, TorqueLimiter
from crgame_ros.driver.evdev_device import EvdevDevice
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.steering import Steering
from evdev import ecodes, ff

FULL_LEVEL = 0x7fff
# Direction of effects in the kernel's units: a force to the left.
LEFTWARDS = 0x4000
# The kernel ends the force if it is not renewed for this long, as by a process that hangs.
LENGTH_MS = 250
RENEWAL_S = 0.05
# Without a new state for this long (a pause, a lost simulation) there is no force [s].
STATE_TIMEOUT_S = 0.2
# Time constant of the low-pass on the wheel's rate, as its angle comes in steps [s].
RATE_FILTER_S = 0.02
# A device that refused an effect is tried again after this time [s].
RETRY_S = 1.0


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


class ForceDevice(Protocol):
    """The part of `evdev.InputDevice` in use; each call is one ioctl or write."""

    def upload_effect(self, effect: ff.Effect) -> int:
        """Create an effect, or change the one with its id; return its id."""

    def write(self, etype: int, code: int, value: int) -> None:
        """Write one event."""

    def erase_effect(self, ff_id: int) -> None:
        """Remove an effect."""


class ForceEffect:
    """
    A constant force that is uploaded once and then changed in place.

    The kernel removes it when the descriptor is closed, however the process ends.

    :param device: open for writing.
    :raises OSError: if it has no room for an effect, or is gone.
    """

    def __init__(self, device: ForceDevice) -> None:
        self.device = device
        kind = ff.EffectType()
        kind.ff_constant_effect = ff.Constant(0, ff.Envelope(0, 0, 0, 0))
        self._effect = ff.Effect(ecodes.FF_CONSTANT, -1, LEFTWARDS, ff.Trigger(0, 0),
                                 ff.Replay(LENGTH_MS, 0), kind)
        self._renewed_s = float('-inf')
        # Switch off the kernel driver's own spring, which would add to this force; devices without
        # it ignore the event.
        device.write(ecodes.EV_FF, ecodes.FF_AUTOCENTER, 0)
        device.write(ecodes.EV_FF, ecodes.FF_GAIN, 0xffff)
        self._effect.id = device.upload_effect(self._effect)

    def set(self, level: int, now_s: float) -> None:  # noqa: A003
        """
        Change the force and renew it.

        :param level: -0x7fff to 0x7fff.
        :param now_s: steady clock [s]
        :raises OSError: if the device is gone.
        """
        self._effect.u.ff_constant_effect.level = max(-FULL_LEVEL, min(FULL_LEVEL, level))
        self.device.upload_effect(self._effect)
        if now_s - self._renewed_s >= RENEWAL_S:
            self._renewed_s = now_s
            self.device.write(ecodes.EV_FF, self._effect.id, 1)

    def remove(self) -> None:
        """
        End the force.

        :raises OSError: if the device is gone.
        """
        self.device.write(ecodes.EV_FF, self._effect.id, 0)
        self.device.erase_effect(self._effect.id)


@dataclass(frozen=True)
class FeltForce:
    """
    The output of the motor.

    :param wheel_angle: positive to the left [rad]
    :param torque: after strength, cap and slew, positive to the left [N m]
    """

    wheel_angle: float
    torque: float


class ForceFeedback:
    """
    The force of one device, without a clock of its own.

    :param device: the wheel; it may be absent, come and go.
    """

    def __init__(self, device: EvdevDevice, vehicle: VehicleParameters) -> None:
        self._device = device
        self._model = SteeringTorque(vehicle)
        self._full_turn = vehicle.max_steering_wheel_angle
        self._effect: ForceEffect | None = None
        self._limiter: TorqueLimiter | None = None
        self._retry_s = self._heard_s = self._stepped_s = -math.inf
        self._time_s = self._speed = self._yaw_rate = 0.0
        self._angle = self._rate = 0.0
        self._off_road = False
        self._collided_s = math.inf
        self.problem = ''

    def see_motion(self, now_s: float, time_s: float, speed: float, yaw_rate: float) -> None:
        """
        Update the vehicle's motion.

        :param now_s: steady clock [s]
        :param time_s: simulation time [s]
        :param speed: signed [m/s]
        :param yaw_rate: [rad/s]
        """
        if time_s == self._time_s:
            return
        if time_s < self._time_s:
            self._collided_s, self._off_road = math.inf, False
        self._heard_s, self._time_s = now_s, time_s
        self._speed, self._yaw_rate = speed, yaw_rate

    def see_drivability(self, collision: bool, off_road: bool) -> None:
        """Update whether the vehicle touches anything, and whether it has left the road."""
        if not collision:
            self._collided_s = math.inf
        elif math.isinf(self._collided_s):
            self._collided_s = self._time_s
        self._off_road = off_road

    def step(self, now_s: float, driving: bool = True) -> FeltForce | None:
        """
        Update the force.

        :param now_s: steady clock [s]
        :param driving: whether the wheel has the vehicle's controls.
        :return: None while there is no motor.
        """
        effect = self._current_effect(now_s)
        layout, limiter = self._device.layout, self._limiter
        if effect is None or layout is None or limiter is None:
            return None
        dt_s = min(now_s - self._stepped_s, STATE_TIMEOUT_S)
        self._stepped_s = now_s
        angle = layout.steering.deflection(self._device.raw) * self._full_turn
        if dt_s > 0.0:
            share = dt_s / (dt_s + RATE_FILTER_S)
            self._rate += share * ((angle - self._angle) / dt_s - self._rate)
        self._angle = angle
        alive = driving and now_s - self._heard_s <= STATE_TIMEOUT_S
        wanted = self._model.torque(WheelMotion(
            self._speed, self._yaw_rate, angle, self._rate, self._time_s, self._off_road,
            self._time_s - self._collided_s if self._collided_s < math.inf else math.inf,
        )) if alive else 0.0
        torque = limiter.step(wanted, dt_s)
        level = round(FULL_LEVEL * torque / limiter.limits.max_torque)
        try:
            effect.set(-level if limiter.limits.inverted else level, now_s)
        except OSError as error:
            self._lose(error, now_s)
            return None
        return FeltForce(angle, torque)

    def close(self) -> None:
        """End the force; the device stays open."""
        if self._effect is not None and self._effect.device is self._device.force_device:
            try:
                self._effect.remove()
            except OSError:
                pass  # The device is gone, and its force with it.
        self._effect = None

    def _current_effect(self, now_s: float) -> ForceEffect | None:
        """Return the effect on the present device, which may differ from the previous one."""
        device, limits = self._device.force_device, self._device.force_limits
        if device is None or limits is None or limits.strength == 0.0:
            self._effect = None
        elif self._effect is None or self._effect.device is not device:
            self._effect = None
            if now_s >= self._retry_s:
                self._begin(device, limits, now_s)
        return self._effect

    def _begin(self, device: ForceDevice, limits: ForceLimits, now_s: float) -> None:
        try:
            self._effect = ForceEffect(device)
        except OSError as error:
            self._lose(error, now_s)
            return
        self._limiter = TorqueLimiter(limits)
        self._stepped_s, self._rate, self.problem = now_s, 0.0, ''

    def _lose(self, error: OSError, now_s: float) -> None:
        self._effect, self._retry_s = None, now_s + RETRY_S
        self.problem = f'no force feedback: {error.strerror or error}'
