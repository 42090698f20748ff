# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The normalised command of a driver, the same for every device (CRG III-C1)."""

from struct import Struct
from typing import NamedTuple

from crgame_ros.vehicle.lights import OF_DRIVERS


class DriverCommand(NamedTuple):
    """
    The command of a seat to its vehicle.

    :param throttle: normalised throttle pedal p_th in [0, 1]
    :param brake: normalised brake pedal p_br in [0, 1]
    :param steering: normalised steering wheel s in [-1, 1], positive to the left
    :param reverse: True while the reverse gear is selected
    :param lights: lights and horn that others see and hear, bits of `Light`; the vehicle's motion
        does not depend on them
    :param put_back: True while the driver requests that the vehicle be put back on its lane, which
        a game with `contact: stop` does after a contact
    """

    throttle: float = 0.0
    brake: float = 0.0
    steering: float = 0.0
    reverse: bool = False
    lights: int = 0
    put_back: bool = False

    def rounded(self) -> 'DriverCommand':
        """
        Clip to the allowed ranges and round to float32, the precision of sensor_msgs/Joy.

        The engine does this to every incoming command, so that live, recorded and replayed
        commands are the same bits. A value that is no number counts as released.
        """
        throttle, brake, steering, reverse, lights, put_back = self
        throttle, brake, steering = _FLOATS32.unpack(_FLOATS32.pack(
            _clipped(throttle, 0.0), _clipped(brake, 0.0), _clipped(steering, -1.0)))
        return DriverCommand(throttle, brake, steering, bool(reverse),
                             int(lights) & OF_DRIVERS, bool(put_back))


RELEASED = DriverCommand()
COMMAND_WIDTH = len(RELEASED)
_FLOATS32 = Struct('3f')


def _clipped(value: float, lower: float) -> float:
    if not value == value:
        return 0.0
    return min(1.0, max(lower, value))
