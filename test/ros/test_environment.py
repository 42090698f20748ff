# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The environment of ROS processes: defaults, free domains, and traffic on loopback only."""

from collections.abc import Iterator
import os
from pathlib import Path
import socket
import subprocess
import sys
import time

from crgame_ros.errors import CrgameError
from crgame_ros.ros import environment
from crgame_ros.ros.environment import (
    free_domain_id,
    listening_beyond_loopback,
    loopback_profile,
    prepare_environment,
    PROFILE_VARIABLES,
    ros_wheels_prefix,
)
import pytest

# DDSI-RTPS 9.6.1.1: unicast discovery port of participant 0 in domain d is 7400 + 250 d + 10.
FIRST_UNICAST = 7410
OURS = ('MPLBACKEND', 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'CRGAME_OPEN_NETWORK', *PROFILE_VARIABLES)
PEER = """
import sys, time
from crgame_ros.ros.environment import prepare_environment
prepare_environment()
import rclpy
from std_msgs.msg import String
from std_srvs.srv import SetBool
me, other = sys.argv[1:]
rclpy.init()
node = rclpy.create_node(f'peer_{me}')
heard = []
node.create_subscription(String, 'chat', lambda message: heard.append(message.data), 10)
publisher = node.create_publisher(String, 'chat', 10)
def answer(request, response):
    response.success, response.message = request.data, me
    return response
node.create_service(SetBool, f'ask_{me}', answer)
client = node.create_client(SetBool, f'ask_{other}')
def tick():
    publisher.publish(String(data=me))
node.create_timer(0.05, tick)
limit = time.monotonic() + 20
future = None
while time.monotonic() < limit and not (other in heard and future and future.done()):
    rclpy.spin_once(node, timeout_sec=0.05)
    if future is None and client.service_is_ready():
        future = client.call_async(SetBool.Request(data=True))
reply = future.result() if future and future.done() else None
print('heard', other in heard, 'answer', reply and (reply.success, reply.message), flush=True)
try:
    rclpy.spin(node)
except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
    pass
node.destroy_node()
rclpy.try_shutdown()
"""


@pytest.fixture
def clean(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Remove what an earlier preparation has set, for this test."""
    for name in OURS:
        monkeypatch.delenv(name, raising=False)
    return monkeypatch


@pytest.fixture
def udp() -> Iterator[socket.socket]:
    """Open a UDP socket for the time of the test."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        yield opened


def test_preparation_keeps_traffic_on_this_machine(clean: pytest.MonkeyPatch) -> None:
    """Unset variables get the loopback defaults."""
    prepare_environment()
    assert os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
    assert {os.environ[name] for name in PROFILE_VARIABLES} == {str(loopback_profile())}
    assert loopback_profile().is_file()
    assert os.environ['MPLBACKEND'] == 'Agg'


def test_preparation_leaves_an_open_network_open(clean: pytest.MonkeyPatch) -> None:
    """With CRGAME_OPEN_NETWORK=1 neither the range nor the profile is set."""
    clean.setenv('CRGAME_OPEN_NETWORK', '1')
    prepare_environment()
    assert not {'ROS_AUTOMATIC_DISCOVERY_RANGE', *PROFILE_VARIABLES} & set(os.environ)


def test_preparation_keeps_the_users_choices(clean: pytest.MonkeyPatch) -> None:
    """A profile, range or backend of the user's own stays."""
    clean.setenv(PROFILE_VARIABLES[0], '/mine.xml')
    clean.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SUBNET')
    clean.setenv('MPLBACKEND', 'svg')
    prepare_environment()
    assert os.environ[PROFILE_VARIABLES[0]] == '/mine.xml'
    assert PROFILE_VARIABLES[1] not in os.environ
    assert os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'SUBNET'
    assert os.environ['MPLBACKEND'] == 'svg'


def test_wheels_are_put_on_the_ament_path_once(clean: pytest.MonkeyPatch) -> None:
    """AMENT_PREFIX_PATH starts with the prefix of the wheels and keeps what was there."""
    prefix = ros_wheels_prefix()
    if prefix is None:
        pytest.skip('ROS comes from a sourced installation')
    assert (prefix / 'share' / 'ament_index').is_dir()
    clean.setenv('AMENT_PREFIX_PATH', '/overlay')
    prepare_environment()
    prepare_environment()
    assert os.environ['AMENT_PREFIX_PATH'] == f'{prefix}:/overlay'


def test_a_domain_in_use_is_not_chosen(monkeypatch: pytest.MonkeyPatch,
                                       udp: socket.socket) -> None:
    """One bound port of a domain is enough; when it is closed the domain is free again."""
    domain = free_domain_id()
    monkeypatch.setattr(environment, 'DOMAIN_IDS', (domain,))
    udp.bind(('127.0.0.1', FIRST_UNICAST + 250 * domain))
    with pytest.raises(CrgameError, match='in use'):
        free_domain_id()
    udp.close()
    assert free_domain_id() == domain


def test_ports_of_ipv6_count(monkeypatch: pytest.MonkeyPatch) -> None:
    """A participant that listens on IPv6 only occupies its domain as well."""
    domain = free_domain_id()
    monkeypatch.setattr(environment, 'DOMAIN_IDS', (domain,))
    with socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as udp6:
        try:
            udp6.bind(('::1', FIRST_UNICAST + 250 * domain))
        except OSError:
            pytest.skip('no IPv6 on this machine')
        with pytest.raises(CrgameError):
            free_domain_id()


def test_domains_differ_between_calls() -> None:
    """Callers at the same time get different domains: 20 draws of 101 are never all the same."""
    drawn = {free_domain_id() for _ in range(20)}
    assert len(drawn) > 1
    assert drawn <= set(range(1, 102))


def test_a_socket_on_every_interface_is_found(udp: socket.socket) -> None:
    """Loopback sockets pass; one on 0.0.0.0 is named with its port."""
    # Of the last domain too it is below the ports that Linux hands out.
    port = FIRST_UNICAST + 250 * free_domain_id() + 20
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as local:
        local.bind(('127.0.0.1', port + 2))
        assert listening_beyond_loopback() == []
        udp.bind(('0.0.0.0', port))
        assert listening_beyond_loopback() == [f'0.0.0.0:{port}']


def _socket_table(pid: int) -> dict[tuple[str, str], int]:
    """Read a process's sockets: (table, hexadecimal local address) and the bytes unread in it."""
    inodes = {os.readlink(entry) for entry in Path(f'/proc/{pid}/fd').iterdir()}
    table = {}
    for name in ('udp', 'udp6', 'tcp', 'tcp6'):
        path = Path('/proc/net') / name
        for line in path.read_text().splitlines()[1:] if path.exists() else []:
            fields = line.split()
            if f'socket:[{fields[9]}]' in inodes:
                table[name, fields[1]] = int(fields[4].partition(':')[2], 16)
    return table


def test_nothing_listens_beyond_loopback(ros_domain: int, clean: pytest.MonkeyPatch,
                                         udp: socket.socket) -> None:
    """
    Two processes talk over topics and services, and read nothing but loopback.

    DDS keeps two sockets that it sends from and never reads, one of them unbound. That they don't
    listen is proven: a datagram sent to them stays unread, while those on loopback are emptied.
    """
    peers = [subprocess.Popen([sys.executable, '-c', PEER, *names], stdout=subprocess.PIPE,
                              text=True) for names in (('a', 'b'), ('b', 'a'))]
    try:
        said = [peer.stdout.readline().strip() for peer in peers if peer.stdout]
        assert said == ["heard True answer (True, 'b')", "heard True answer (True, 'a')"]
        for peer in peers:
            sockets = _socket_table(peer.pid)
            assert {table for table, _ in sockets} == {'udp'}
            beyond = [address for _, address in sockets if not address.startswith('0100007F')]
            loopback = f'0100007F:{FIRST_UNICAST + 250 * ros_domain:04X}'
            for address in (*beyond, loopback):
                ip, _, port = address.partition(':')
                host = socket.inet_ntoa(bytes.fromhex(ip)[::-1])
                udp.sendto(b'x' * 32, (host.replace('0.0.0.0', '127.0.0.1'), int(port, 16)))
            time.sleep(0.3)
            after = _socket_table(peer.pid)
            assert all(after['udp', address] > 0 for address in beyond)
            assert after.get(('udp', loopback), 0) == 0
    finally:
        # How a bare script of rclpy ends is not the question here; once, one did not in 20 s.
        for peer in peers:
            peer.kill()
        for peer in peers:
            peer.communicate(timeout=20)


@pytest.mark.exhaustive
def test_another_pythons_ros_is_told_in_one_line(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nodes and the launcher name this Python and the remedy; there is no traceback."""
    sourced = tmp_path / 'jazzy'
    (sourced / 'rclpy').mkdir(parents=True)
    (sourced / 'rclpy' / '__init__.py').write_text('import rclpy._rclpy_pybind11\n')
    compiled = sourced / 'rclpy' / '_rclpy_pybind11.cpython-39-x86_64-linux-gnu.so'
    compiled.touch()
    nowhere = tmp_path / 'nowhere'
    nowhere.mkdir()
    (nowhere / 'sitecustomize.py').write_text(
        'from importlib.machinery import PathFinder\n'
        'found = PathFinder.find_spec\n'
        'PathFinder.find_spec = classmethod(lambda cls, name, path=None, target=None:\n'
        '    None if name == "rclpy" else found(name, path, target))\n')
    root = Path(environment.__file__).parents[2]
    for folder, text in ((sourced, f'the rclpy in {sourced / "rclpy"} is not for Python '),
                         (nowhere, 'there is no ROS 2 (rclpy) for Python ')):
        for module in ('crgame_ros.nodes.sim_node', 'crgame_ros.launcher.main'):
            done = subprocess.run(
                [sys.executable, '-m', module], capture_output=True, text=True, cwd=tmp_path,
                env=dict(os.environ, PYTHONPATH=f'{folder}{os.pathsep}{root}'), timeout=60)
            assert done.returncode == 1, done
            assert done.stderr.startswith(f'error: {text}'), done.stderr
            assert done.stderr.count('\n') == 1 and sys.executable in done.stderr
            assert './run.sh' in done.stderr
    # What fits is taken, whatever else lies beside it.
    for suffix in environment.EXTENSION_SUFFIXES:
        (compiled.parent / f'_rclpy_pybind11{suffix}').touch()
    monkeypatch.syspath_prepend(str(sourced))
    monkeypatch.delitem(sys.modules, 'rclpy', raising=False)
    environment.require_ros()
