# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The environment that a ROS process needs: loopback only, and the path of the ROS wheels."""

from collections.abc import Iterator
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec
import os
from pathlib import Path
import random
import socket
import sys

from crgame_ros.errors import CrgameError
from crgame_ros.paths import config_directory

OPEN_NETWORK = 'CRGAME_OPEN_NETWORK'
# Fast DDS reads the first name up to version 2.x and the second from 3.0 on.
PROFILE_VARIABLES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')
COMPILED_RCLPY = '_rclpy_pybind11'
DOMAIN_IDS = range(1, 102)
# DDSI-RTPS 9.6.1.1: the ports of a domain start at PB + DG * domain and fill DG ports.
PORT_BASE = 7400
PORTS_PER_DOMAIN = 250
# DDS listens below Linux's ephemeral ports; the ports that it only sends from are above.
EPHEMERAL_PORT = 32768


def loopback_profile() -> Path:
    """Find the Fast DDS profile that keeps all traffic on this machine."""
    return config_directory() / 'fastdds_loopback.xml'


def is_loopback_profile(path: str) -> bool:
    """Return whether a Fast DDS profile is that of the package, or of another copy of it."""
    try:
        return Path(path).read_bytes() == loopback_profile().read_bytes()
    except OSError:
        return False


def network_is_open() -> bool:
    """Return whether the user lets ROS traffic leave this machine."""
    return os.environ.get(OPEN_NETWORK) == '1'


def ros_wheels_prefix() -> Path | None:
    """
    Find the prefix of the ROS wheels.

    :return: the directory to put on ``AMENT_PREFIX_PATH``, or None if rclpy comes from a sourced
        installation or is missing.
    """
    spec = find_spec('rclpy')
    if spec is None or spec.origin is None or find_spec('ros_wheels_bootstrapper') is None:
        return None
    prefix = Path(sys.prefix)
    return prefix if Path(spec.origin).is_relative_to(prefix) else None


def require_ros() -> None:
    """
    Check that there is an rclpy for this Python; call it before the first ``import rclpy``.

    :raises CrgameError: if there is none; the message says what to do.
    """
    python = f'Python {sys.version_info.major}.{sys.version_info.minor} ({sys.executable})'
    spec = find_spec('rclpy')
    if spec is None or spec.origin is None:
        raise CrgameError(f'there is no ROS 2 (rclpy) for {python}; start through ./run.sh, which '
                          'brings it, or source /opt/ros/jazzy/setup.bash')
    folder = Path(spec.origin).parent
    compiled = {path.name for path in folder.glob(f'{COMPILED_RCLPY}*')}
    if compiled and not any(f'{COMPILED_RCLPY}{suffix}' in compiled
                            for suffix in EXTENSION_SUFFIXES):
        raise CrgameError(f'the rclpy in {folder} is not for {python}, only {min(compiled)}; use '
                          'that Python, or start through ./run.sh in a terminal without that ROS')


def prepare_environment() -> None:
    """
    Set what is unset in the environment; call it before the first ``import rclpy``.

    Traffic stays on this machine unless ``CRGAME_OPEN_NETWORK=1`` or the user has a Fast DDS
    profile of their own.

    :raises CrgameError: if the package's data files are not installed.
    """
    os.environ.setdefault('MPLBACKEND', 'Agg')
    prefix = ros_wheels_prefix()
    if prefix is not None:
        _prepend('AMENT_PREFIX_PATH', str(prefix))
        os.environ.setdefault('RMW_IMPLEMENTATION', 'rmw_fastrtps_cpp')
        # ROS tools that are started from here ask for it.
        os.environ['ROS_DISTRO'] = 'jazzy'
    if network_is_open():
        return
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    if not any(os.environ.get(name) for name in PROFILE_VARIABLES):
        for name in PROFILE_VARIABLES:
            os.environ[name] = str(loopback_profile())


def free_domain_id() -> int:
    """
    Choose a ``ROS_DOMAIN_ID`` whose ports no process on this machine uses now.

    The choice is random, so that simultaneous callers get different ids.

    :return: a domain id from 1 to 101, the range whose ports Linux does not assign by default.
    :raises CrgameError: if every domain is in use.
    """
    used = {(port - PORT_BASE) // PORTS_PER_DOMAIN
            for table in ('udp', 'udp6') for _, _, port in _sockets(table)}
    free = [domain for domain in DOMAIN_IDS if domain not in used]
    if not free:
        raise CrgameError('every ROS_DOMAIN_ID from 1 to 101 is in use on this machine; '
                          'stop some ROS processes or set ROS_DOMAIN_ID')
    return random.SystemRandom().choice(free)


def listening_beyond_loopback() -> list[str]:
    """
    Find this process's sockets that take datagrams or connections from other machines.

    Sockets on ephemeral ports are left out: DDS sends from them and never reads them.

    :return: `address:port` of each, empty where all of them are bound to loopback.
    """
    inodes = set()
    for entry in os.listdir('/proc/self/fd'):
        try:
            inodes.add(os.readlink(f'/proc/self/fd/{entry}').removeprefix('socket:').strip('[]'))
        except FileNotFoundError:  # the descriptor of this listing itself
            continue
    found = []
    for table in ('udp', 'udp6', 'tcp', 'tcp6'):
        for inode, address, port in _sockets(table):
            loopback = address == '::1' or address.startswith('127.')
            if inode in inodes and not loopback and port < EPHEMERAL_PORT:
                found.append(f'{address}:{port}')
    return found


def _prepend(variable: str, entry: str) -> None:
    """Prepend an entry to a path variable unless it is already there."""
    entries = [part for part in os.environ.get(variable, '').split(os.pathsep) if part]
    if entry not in entries:
        os.environ[variable] = os.pathsep.join([entry, *entries])


def _sockets(table: str) -> Iterator[tuple[str, str, int]]:
    """Read the inode, local address and local port of every socket in a table of /proc/net."""
    path = Path('/proc/net') / table
    if not path.exists():  # no IPv6 on this machine
        return
    for line in path.read_text().splitlines()[1:]:
        fields = line.split()
        address, _, port = fields[1].partition(':')
        # Groups of four bytes, each in host order.
        raw = b''.join(bytes.fromhex(address[i:i + 8])[::-1] for i in range(0, len(address), 8))
        family = socket.AF_INET if len(raw) == 4 else socket.AF_INET6
        yield fields[9], socket.inet_ntop(family, raw), int(port, 16)
