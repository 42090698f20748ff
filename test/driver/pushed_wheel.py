# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A wheel with a motor whose file is a socket, so that a test can read what is written."""

import ctypes
import math
from pathlib import Path
import socket
import struct
import sys
from tempfile import gettempdir
import time
from typing import Any

from crgame_ros.driver.device_map import ForceLimits, load_device_map
from crgame_ros.driver.evdev_device import EvdevDevice, EventDecoder
from crgame_ros.driver.force_feedback import ForceFeedback
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.steering import Steering
from evdev import ecodes, ff
from scipy.optimize import brentq

# Format: a mark, then the bytes of the ioctl or of the event.
UPLOAD, EVENT, ERASE = b'U', b'E', b'X'
EVENT_FORMAT = 'HHi'
EFFECT_SIZE = ctypes.sizeof(ff.Effect)


def wheel_at(speed: float, yaw_rate: float) -> float:
    """Return the steering wheel angle of the usual vehicle in a steady turn [rad]."""
    car = load_vehicle_parameters()
    steering, full = Steering(car), car.max_steering_wheel_angle
    angle = math.atan(car.wheelbase * yaw_rate / speed)
    return full * brentq(lambda share: steering.target_angle(share, speed) - angle, -1.0, 1.0)


def raw_of(angle: float) -> int:
    """Return what a G29 reports at an angle [rad]: 0 is 7.85 rad to the left."""
    return round(32767.5 * (1.0 - angle / 7.85))


class Motor:
    """Stands for evdev on a descriptor: uploads and writes; it has room for one effect."""

    def __init__(self, file: socket.socket | None = None) -> None:
        self.file = file
        self.levels: list[int] = []
        self.events: list[tuple[int, int, int]] = []
        self.effects: set[int] = set()
        self.error: OSError | None = None

    def upload_effect(self, effect: ff.Effect) -> int:
        """Upload an effect as EVIOCSFF does."""
        data = memoryview(effect).tobytes()
        self._send(UPLOAD + data)
        read = ff.Effect.from_buffer_copy(data)
        assert read.type == ecodes.FF_CONSTANT
        if read.id == -1:
            assert not self.effects, 'a second effect'
            self.effects.add(7)
        else:
            assert {read.id} == self.effects
        self.levels.append(read.u.ff_constant_effect.level)
        return 7

    def write(self, etype: int, code: int, value: int) -> None:
        """Write an event."""
        self._send(EVENT + struct.pack(EVENT_FORMAT, etype, code, value))
        self.events.append((etype, code, value))

    def erase_effect(self, ff_id: int) -> None:
        """Remove an effect as EVIOCRMFF does."""
        self._send(ERASE)
        self.effects.remove(ff_id)

    def _send(self, data: bytes) -> None:
        if self.error is not None:
            raise self.error
        if self.file is not None:
            self.file.sendall(struct.pack('H', len(data)) + data)


class PushedWheel(EvdevDevice):
    """
    A G29 that is fed by its decoder, and whose motor is a double.

    :ivar motor: what is plugged in; None while it is unplugged.
    """

    def __init__(self, motor: Motor | None, limits: ForceLimits | None = None) -> None:
        device_map = load_device_map('logitech_g29')
        super().__init__((device_map,), directory=Path(gettempdir()) / 'no devices')
        self.device_map, self.layout = device_map, device_map.layout('evdev')
        self.decoder = EventDecoder(self.layout.gear)
        self.motor = motor
        self.limits = limits or device_map.force_feedback

    def turn(self, angle: float) -> None:
        """Turn the wheel to an angle [rad]."""
        self.decoder.axes[ecodes.ABS_X] = raw_of(angle)

    @property
    def force_device(self) -> Any:
        """Return the double."""
        return self.motor

    @property
    def force_limits(self) -> ForceLimits | None:
        """Return its limits."""
        return self.limits if self.motor is not None else None


def main() -> None:
    """Push hard to the right forever, in the inherited file."""
    wheel = PushedWheel(Motor(socket.socket(fileno=int(sys.argv[1]))))
    wheel.turn(wheel_at(20.0, 0.3))
    force = ForceFeedback(wheel, load_vehicle_parameters())
    n = 0
    while True:
        n += 1
        force.see_motion(time.monotonic(), 0.01 * n, 20.0, 0.3)
        force.step(time.monotonic())
        time.sleep(0.005)


if __name__ == '__main__':
    main()
