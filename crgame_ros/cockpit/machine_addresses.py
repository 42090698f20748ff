# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The addresses under which other machines reach this one."""

import fcntl
import ipaddress
from pathlib import Path
import socket
import struct

# The request to Linux for the IPv4 address of an interface.
_SIOCGIFADDR = 0x8915
_IF_INET6 = Path('/proc/net/if_inet6')
_GLOBAL = '00'


def reachable_addresses(host: str) -> tuple[str, ...]:
    """
    Return the addresses at which other machines reach a server that listens on one.

    :param host: an address, or `0.0.0.0` or `::` for all of this machine.
    :return: for all, those of the interfaces; loopback only if there is no other.
    """
    if host == '0.0.0.0':
        return _version_4() or ('127.0.0.1',)
    if host == '::':
        return (*_version_4(), *_version_6()) or ('::1',)
    return (host,)


def _version_4() -> tuple[str, ...]:
    found: dict[str, None] = {}
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        for _, name in socket.if_nameindex():
            request = struct.pack('256s', name.encode()[:15])
            try:
                answer = fcntl.ioctl(probe.fileno(), _SIOCGIFADDR, request)
            except OSError:
                # The interface has no such address.
                continue
            found[socket.inet_ntoa(answer[20:24])] = None
    return tuple(item for item in found if not ipaddress.ip_address(item).is_loopback)


def _version_6() -> tuple[str, ...]:
    try:
        rows = [line.split() for line in _IF_INET6.read_text().splitlines()]
    except OSError:
        return ()
    return tuple(str(ipaddress.IPv6Address(int(row[0], 16))) for row in rows
                 if len(row) == 6 and row[3] == _GLOBAL)
