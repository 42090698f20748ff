# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The streams that a run sends: names, channels, units."""

from dataclasses import dataclass

from crgame_ros.timing.cycle_rows import COMMAND_COLUMNS
from crgame_ros.vehicle.state import StateColumn

# Each stream is a server with threads of its own, and liblsl has 32 ports for them.
MAX_VEHICLES = 12


@dataclass(frozen=True)
class Channel:
    """
    A channel of a stream.

    :param name: of it.
    :param unit: of its values, SI; `normalized` for a bare number.
    :param what: kind of quantity.
    """

    name: str
    unit: str
    what: str


@dataclass(frozen=True)
class StreamDescription:
    """
    A stream.

    :param name: of it.
    :param type: kind of its content.
    :param channels: of it.
    :param rate_hz: nominal; 0 if it is irregular [Hz]
    :param texts: whether its values are texts.
    """

    name: str
    type: str  # noqa: A003
    channels: tuple[Channel, ...]
    rate_hz: float = 0.0
    texts: bool = False


MARKERS = StreamDescription('crgame_ros markers', 'Markers', (Channel('marker', '', 'Marker'),),
                            texts=True)
_STATE = {
    StateColumn.X: Channel('x', 'm', 'PositionX'), StateColumn.Y: Channel('y', 'm', 'PositionY'),
    StateColumn.YAW: Channel('yaw', 'rad', 'OrientationYaw'),
    StateColumn.SPEED: Channel('speed', 'm/s', 'Velocity'),
    StateColumn.STEERING_ANGLE: Channel('steering_angle', 'rad', 'Angle'),
    StateColumn.ACCELERATION: Channel('acceleration', 'm/s^2', 'Acceleration'),
    StateColumn.YAW_RATE: Channel('yaw_rate', 'rad/s', 'AngularVelocity'),
    StateColumn.STEERING_RATE: Channel('steering_rate', 'rad/s', 'AngularVelocity')}


def vehicle_stream(vehicle_id: str, rate_hz: float) -> StreamDescription:
    """Return the stream of a vehicle's state: the rear axle in the frame map."""
    return StreamDescription(f'crgame_ros vehicle {vehicle_id}', 'Vehicle',
                             tuple(_STATE[column] for column in StateColumn), rate_hz)


def driver_stream(vehicle_id: str, rate_hz: float) -> StreamDescription:
    """Return the stream of a driver's consumed commands, NaN while an AV follows its plan."""
    return StreamDescription(f'crgame_ros driver {vehicle_id}', 'Driver', tuple(
        Channel(name, 'normalized', 'Control') for name in COMMAND_COLUMNS), rate_hz)
