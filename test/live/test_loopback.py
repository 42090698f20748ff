# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The sockets of a running graph: none receives anything from another machine."""

from collections.abc import Iterator
import os
from pathlib import Path
import socket
from typing import NamedTuple

from crgame_ros.ros.environment import PORT_BASE, PORTS_PER_DOMAIN
from live_peer import Peer
from live_support import CUT_IN, Launcher, wait_until
import pytest

TABLES = ('udp', 'udp6', 'tcp', 'tcp6')
DATAGRAM = b'x' * 32


class Endpoint(NamedTuple):
    """A socket of a process, as /proc/net lists it."""

    table: str
    address: str
    port: int
    unread: int

    @property
    def on_loopback(self) -> bool:
        """Return whether only this machine can reach it."""
        return self.address.startswith('127.') or self.address == '::1'


def sockets_of(pid: int) -> list[Endpoint]:
    """List the sockets that a process holds, by the inodes of its open files."""
    inodes = set()
    for entry in Path(f'/proc/{pid}/fd').iterdir():
        try:
            inodes.add(os.readlink(entry))
        except FileNotFoundError:
            continue
    found = []
    for table in TABLES:
        path = Path('/proc/net') / table
        for line in path.read_text().splitlines()[1:] if path.exists() else []:
            fields = line.split()
            if f'socket:[{fields[9]}]' not in inodes:
                continue
            words, _, port = fields[1].partition(':')
            raw = b''.join(bytes.fromhex(words[index:index + 8])[::-1]
                           for index in range(0, len(words), 8))
            family = socket.AF_INET if len(raw) == 4 else socket.AF_INET6
            found.append(Endpoint(table, socket.inet_ntop(family, raw), int(port, 16),
                                  int(fields[4].partition(':')[2], 16)))
    # While a socket is bound, Linux shows its port as 0 for a moment.
    return found if all(item.port for item in found) else sockets_of(pid)


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launcher]:
    """Start a graph and wait until it drives, so that every node has all its sockets."""
    with Launcher([CUT_IN], tmp_path_factory.mktemp('loopback') / 'run') as launcher, \
            Peer(launcher.domain, '/clock', '/scenario/game') as peer:
        peer.wait_until(lambda: peer.n > 20, 'n = 20')
        yield launcher


def test_every_receiving_socket_is_on_loopback(graph: Launcher) -> None:
    """
    Sockets are on 127.0.0.1, but for those that DDS sends from and never reads.

    Such a socket is a UDP one with a port that the system chose: one without an address and one
    for each interface, to send from. The test proves that they receive nothing: data sent to
    them stays unread for the life of the process, while data sent to the others is read.
    """
    lowest = int(Path('/proc/sys/net/ipv4/ip_local_port_range').read_text().split()[0])
    domain = range(PORT_BASE + PORTS_PER_DOMAIN * graph.domain,
                   PORT_BASE + PORTS_PER_DOMAIN * (graph.domain + 1))
    assert sockets_of(graph.pid) == []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender, \
            Peer(graph.domain, '/clock', '/scenario/game') as peer:
        for name, pid in graph.started:
            endpoints = sockets_of(pid)
            assert {item.table for item in endpoints} == {'udp'}, name
            beyond = [item for item in endpoints if not item.on_loopback]
            low = [item for item in beyond if item.port < lowest]
            assert not low, f'{name} binds {low}'
            inbound = [item for item in endpoints if item.on_loopback and item.port in domain]
            # Discovery and user traffic of the participant, as DDSI-RTPS numbers them.
            assert len(inbound) >= 2, name
            for item in (*beyond, *inbound):
                host = '127.0.0.1' if item.address == '0.0.0.0' else item.address
                sender.sendto(DATAGRAM, (host, item.port))
        peer.wait_until(lambda: peer.n > 0, 'the graph still at work')
        later = peer.n + 20
        peer.wait_until(lambda: peer.n > later, f'n = {later}')
        for name, pid in graph.started:
            for item in sockets_of(pid):
                if not item.on_loopback:
                    assert item.unread >= len(DATAGRAM), f'{name} reads {item}'
            # Other senders use them too: at some moment nothing is left.
            waiting = {item.port for item in sockets_of(pid)
                       if item.on_loopback and item.port in domain}

            def read(pid: int = pid, waiting: set[int] = waiting) -> bool:
                waiting -= {item.port for item in sockets_of(pid) if item.unread == 0}
                return not waiting
            wait_until(read, f'{name} to read what is sent to it')


def test_nothing_answers_at_the_outer_addresses(graph: Launcher) -> None:
    """The ports of the domain are free on this machine's address for others, if it has one."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            # Nothing is sent: this only asks the routing table for the address.
            probe.connect(('192.0.2.1', 9))
        except OSError:
            pytest.skip('this machine has no address but loopback')
        outer = probe.getsockname()[0]
    ports = {item.port for _, pid in graph.started for item in sockets_of(pid)
             if item.on_loopback and item.port < 32768}
    assert ports
    for port in ports:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            # It would be in use if a socket were bound to it there or on 0.0.0.0.
            free.bind((outer, port))
