# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Keeps LSL on this machine.

liblsl's own setting of the scope restricts how streams are sought, over IPv4 and IPv6. But its
servers listen on every interface, whatever is set: another machine that knows a port could read.
So their sockets are bound to the loopback device, which the kernel (5.7 or newer) grants to
everybody. What seeks streams still takes answers from everywhere, as liblsl opens its sockets
again and again; but its questions do not leave the machine.
"""

from collections.abc import Callable
import os
from pathlib import Path
import socket
from typing import TypeVar

from crgame_ros.errors import CrgameError

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
