# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The streams of a run for other programs, as LSL outlets, kept on this machine.

liblsl's own setting of the scope restricts how streams are sought, over IPv4 and IPv6. But its
servers listen on every interface, whatever is set: another machine that knows a port could read.
So their sockets are bound to the loopback device, which the kernel (5.7 or newer) grants to
everybody. What seeks streams still takes answers from everywhere, as liblsl opens its sockets
again and again; but its questions do not leave the machine.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import os
from pathlib import Path
import platform
import socket
from typing import Any, TypeVar

from crgame_ros.errors import CrgameError
from crgame_ros.game.instruments_spec import InstrumentsSpec
from crgame_ros.timing.cycle_rows import COMMAND_COLUMNS
from crgame_ros.vehicle.state import StateColumn
from crgame_ros.version import __version__

# Begins the ids of streams of this package.
OWN = 'crgame_ros/'
T = TypeVar('T')
# What matters is told by this package, in one line each; liblsl would tell of every connection.
CONFIGURATION = """
[ports]
IPv6 = disable
[multicast]
ResolveScope = machine
ListenAddress = 127.0.0.1
Interfaces = {127.0.0.1}
[log]
level = -3
"""
_DEVICE = b'lo'
# Each stream is a server with threads of its own, and liblsl has 32 ports for them.
MAX_VEHICLES = 12


class OpenSocketError(CrgameError):
    """The failure to keep a socket on this machine."""


def on_loopback(make: Callable[[], T]) -> T:
    """
    Make something that opens sockets, and bind these to the loopback device.

    :raises OpenSocketError: if the kernel refuses.
    """
    before = _sockets()
    made = make()
    for number in _sockets() - before:
        _restrict(number)
    return made


def _sockets() -> set[int]:
    """Return the numbers of this process's open sockets."""
    found = set()
    for entry in Path('/proc/self/fd').iterdir():
        try:
            if os.readlink(entry).startswith('socket:'):
                found.add(int(entry.name))
        except OSError:
            # Closed since.
            continue
    return found


def _restrict(number: int) -> None:
    try:
        copy = socket.socket(fileno=os.dup(number))
    except OSError:
        # Closed since.
        return
    with copy:
        if copy.family not in (socket.AF_INET, socket.AF_INET6):
            return
        try:
            copy.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, _DEVICE)
        except OSError as error:
            raise OpenSocketError(
                f'instruments: LSL cannot be kept on this machine ({error.strerror}); use Linux '
                '5.7 or newer, or give "scope: network"') from error


@dataclass(frozen=True)
class Channel:
    """
    A channel of a stream.

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

    :param type: kind of its content.
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
    """Return the stream of consumed commands, NaN but for lights while an AV follows its plan."""
    return StreamDescription(f'crgame_ros driver {vehicle_id}', 'Driver', tuple(
        Channel(name, 'normalized', 'Control') for name in COMMAND_COLUMNS), rate_hz)


def configure(spec: InstrumentsSpec) -> None:
    """Keep liblsl on this machine, unless the game opens it; before all else of liblsl."""
    if spec.scope == 'machine':
        import pylsl
        pylsl.set_config_content(CONFIGURATION)


class Outlet:
    """
    A stream.

    :param domain: the ROS domain: two runs on one machine send different streams.
    :param local: whether it stays on this machine.
    :raises CrgameError: if it cannot.
    """

    def __init__(self, stream: StreamDescription, domain: str, local: bool) -> None:
        import pylsl
        self.source_id = f'{OWN}{platform.node()}/{domain}/{stream.name}'
        info = pylsl.StreamInfo(
            stream.name, stream.type, len(stream.channels), stream.rate_hz or
            pylsl.IRREGULAR_RATE, pylsl.cf_string if stream.texts else pylsl.cf_double64,
            self.source_id)
        _describe(info, stream)
        self._outlet = on_loopback(lambda: pylsl.StreamOutlet(info)) if local \
            else pylsl.StreamOutlet(info)

    def push(self, values: Sequence[float] | Sequence[str], steady_s: float) -> None:
        """Send a sample with its time on the steady clock [s]."""
        self._outlet.push_sample(values, steady_s)


def _describe(info: Any, stream: StreamDescription) -> None:
    """Describe the channels as XDF has it (https://github.com/sccn/xdf/wiki/Meta-Data)."""
    channels = info.desc().append_child('channels')
    for channel in stream.channels:
        entry = channels.append_child('channel')
        entry.append_child_value('label', channel.name)
        entry.append_child_value('unit', channel.unit)
        entry.append_child_value('type', channel.what)
    made_by = info.desc().append_child('acquisition')
    made_by.append_child_value('manufacturer', 'crgame_ros')
    made_by.append_child_value('version', __version__)
