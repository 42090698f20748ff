# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Force feedback: the force of a wheel's motor over time, from the vehicle's motion."""

from dataclasses import dataclass
import math
from typing import Protocol

from crgame_ros.driver.evdev_device import EvdevDevice
from crgame_ros.driver.force_limits import ForceLimits, TorqueLimiter
from crgame_ros.driver.steering_torque import SteeringTorque, WheelMotion
from crgame_ros.vehicle.parameters import VehicleParameters
from evdev import ecodes, ff

FULL_LEVEL = 0x7fff
# Direction of effects in the kernel's units: a force to the left.
LEFTWARDS = 0x4000
# The kernel ends the force if it is not renewed for this long, as by a process that hangs.
LENGTH_MS = 250
RENEWAL_S = 0.05


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


# Without a new state for this long (a pause, a lost simulation) there is no force [s].
STATE_TIMEOUT_S = 0.2
# Time constant of the low-pass on the wheel's rate, as its angle comes in steps [s].
RATE_FILTER_S = 0.02
# A device that refused an effect is tried again after this time [s].
RETRY_S = 1.0


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
    :param vehicle: that it steers.
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
                self._begin(limits, now_s)
        return self._effect

    def _begin(self, limits: ForceLimits, now_s: float) -> None:
        try:
            self._effect = ForceEffect(self._device.force_device)
        except OSError as error:
            self._lose(error, now_s)
            return
        self._limiter = TorqueLimiter(limits)
        self._stepped_s, self._rate, self.problem = now_s, 0.0, ''

    def _lose(self, error: OSError, now_s: float) -> None:
        self._effect, self._retry_s = None, now_s + RETRY_S
        self.problem = f'no force feedback: {error.strerror or error}'
