# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The checks of `crgame doctor`: problems of this machine, with a remedy for each."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version
import json
import os
from pathlib import Path
import shutil
import statistics
import subprocess
import sys
import time
from typing import Literal

from crgame_ros.page_libraries import COMMAND, find_libraries
from crgame_ros.paths import share_directory
from crgame_ros.registry import PACKAGES, planner_packages_install
from crgame_ros.ros.environment import (
    free_domain_id,
    is_loopback_profile,
    network_is_open,
    prepare_environment,
    PROFILE_VARIABLES,
    ros_wheels_prefix,
)
from packaging.requirements import Requirement

# The pins of the source tree: for every run, and for planners of CommonRoad's packages.
PINS, PLANNER_PINS = 'requirements.txt', 'requirements-planners.txt'


def read_pins(folder: Path) -> Iterator[Requirement]:
    """Read the pinned packages of both files in a folder, without their hashes."""
    for name in (PINS, PLANNER_PINS):
        for line in (folder / name).read_text(encoding='utf-8').splitlines():
            if '==' in line and not line.startswith('#'):
                yield Requirement(line.removesuffix('\\'))


def needed(folder: Path, *, wheels: bool) -> list[Requirement]:
    """
    Return the packages that this installation needs to run.

    These are the pins if scripts/env.sh has created the environment, or if the package is not
    installed; otherwise the requirements of the installed package.

    :param folder: with the files of pins.
    :param wheels: whether ROS comes from wheels, which are then needed too.
    """
    try:
        declared = requires('crgame_ros') or []
    except PackageNotFoundError:
        declared = []
    if not declared or (Path(sys.prefix) / 'stamp').is_file():
        found = list(read_pins(folder))
    else:
        found = [item for item in map(Requirement, declared)
                 if item.marker is None or item.marker.evaluate({'extra': ''})]
    return [item for item in found if wheels or not item.name.startswith('ros-')]


Status = Literal['ok', 'warn', 'fail']

MODULES = (
    'numpy', 'scipy', 'shapely', 'matplotlib', 'lxml.etree', 'yaml', 'evdev', 'aiohttp', 'numba',
    'rclpy', 'sensor_msgs.msg', 'nav_msgs.msg', 'trajectory_msgs.msg', 'diagnostic_msgs.msg',
    'visualization_msgs.msg', 'rosgraph_msgs.msg', 'std_srvs.srv', 'commonroad.scenario.scenario',
    'commonroad_clcs.clcs', 'commonroad_dc.pycrcc', 'commonroad_idm_planner.idm_planner',
    'commonroad_rp.reactive_planner', 'mcap.writer', 'rosbags.highlevel', 'zstandard',
)
# For polygon3, which must be compiled and is needed only by planners of CommonRoad's packages.
COMPILE_FIX = 'apt install gcc python3-dev, remove .venv and start again'
# Packages needed by those planners only.
OF_SOME_PLANNERS = {'Polygon', *PACKAGES}
PROBE_TIMEOUT_S = 60.0
JITTER_SLEEPS = 200
JITTER_PERIOD_NS = 5_000_000
# Above this the host, not the program, decides the timing: a twentieth of a 10 ms cycle.
JITTER_P99_LIMIT_MS = 0.5
DISK_WARN_GB = 5.0
DISK_FAIL_GB = 0.2


@dataclass(frozen=True)
class Check:
    """
    One line of the report.

    :param detail: the finding.
    :param remedy: what to do about it; empty if nothing is to be done.
    """

    name: str
    status: Status
    detail: str
    remedy: str = ''


def run_checks(runs: Path | None = None) -> list[Check]:
    """Run all checks, in some seconds; recordings go to `runs`, by default ./runs."""
    prepare_environment()
    return [check_python(), *check_packages(share_directory()),
            check_imports(), check_page_libraries(), check_ros(), check_profile(), check_devices(),
            check_priority(), *check_discovery(), check_disk(runs or Path('runs')),
            check_processors(), check_clock()]


def format_checks(checks: list[Check]) -> str:
    """Return the checks as text, each remedy under its check."""
    lines = []
    width = max((len(check.name) for check in checks), default=0)
    for check in checks:
        lines.append(f'{check.status:<4}  {check.name:<{width}}  {check.detail}')
        if check.remedy:
            lines.append(f'{"":<4}  {"":<{width}}  -> {check.remedy}')
    counts = Counter(check.status for check in checks)
    lines.append(f'{len(checks)} checks: {counts["fail"]} failed, {counts["warn"]} warnings')
    return '\n'.join(lines)


def main() -> int:
    """Print the report; return 1 if a check failed, else 0."""
    checks = run_checks()
    print(format_checks(checks))
    return 1 if any(check.status == 'fail' for check in checks) else 0


def check_python() -> Check:
    """Check the interpreter: the packages exist for 3.11 and 3.12."""
    found = '.'.join(map(str, sys.version_info[:3]))
    if sys.version_info[:2] in ((3, 11), (3, 12)):
        return Check('Python', 'ok', f'{found} ({sys.executable})')
    return Check('Python', 'fail', f'{found} ({sys.executable})',
                 'use Python 3.11 or 3.12: PYTHON=python3.12 ./run.sh')


def check_packages(folder: Path) -> list[Check]:
    """Compare the installed packages with the needed ones; one check for each that differs."""
    checks = []
    right = 0
    for item in needed(folder, wheels=ros_wheels_prefix() is not None):
        remedy = COMPILE_FIX if item.name == 'polygon3' else f'pip install --no-deps "{item}"'
        try:
            found = version(item.name)
        except PackageNotFoundError:
            status: Status = 'warn' if item.name == 'polygon3' else 'fail'
            checks.append(Check(item.name, status, f'not installed, {item.specifier} wanted',
                                remedy))
            continue
        if item.specifier.contains(found):
            right += 1
        else:
            checks.append(Check(item.name, 'warn', f'{found}, while {item.specifier} was tried',
                                remedy))
    return [Check('packages', 'ok', f'{right} as tried, {len(checks)} not'), *checks]


def check_imports(modules: tuple[str, ...] = MODULES) -> Check:
    """Import the programs' modules in a separate process."""
    code = ('import importlib, json, sys\n'
            'errors = {}\n'
            'for name in sys.argv[1:]:\n'
            '    try:\n'
            '        importlib.import_module(name)\n'
            '    except Exception as error:\n'
            '        errors[name] = str(error), getattr(error, "name", None)\n'
            'print(json.dumps(errors))\n')
    done = _run([sys.executable, '-c', code, *modules])
    if done.returncode != 0:
        return Check('imports', 'fail', _last_line(done.stderr), 'remove .venv and start again')
    errors = json.loads(done.stdout.splitlines()[-1])
    if not errors:
        return Check('imports', 'ok', f'{len(modules)} modules import')
    detail = '; '.join(f'{name}: {error}' for name, (error, _) in errors.items())
    absent = {(module or '').partition('.')[0] for _, module in errors.values()}
    if absent <= OF_SOME_PLANNERS:
        return Check('imports', 'warn', f'without planners reactive, reactive-package or '
                     f'idm-package: {detail}',
                     COMPILE_FIX if absent == {'Polygon'} else planner_packages_install())
    return Check('imports', 'fail', detail, 'remove .venv and start again')


def check_page_libraries() -> Check:
    """Check whether pages can show their 3D view and plots."""
    if find_libraries() is None:
        return Check('page libraries', 'warn', 'three.js and Plotly are not there: the cockpit '
                     'shows neither its 3D view nor plots, and reports cannot be made', COMMAND)
    return Check('page libraries', 'ok', 'three.js and Plotly')


def check_ros() -> Check:
    """Check the origin of ROS and its middleware."""
    middleware = os.environ.get('RMW_IMPLEMENTATION') or 'the default middleware'
    if ros_wheels_prefix() is not None:
        return Check('ROS 2', 'ok', f'Jazzy from wheels, {middleware}')
    distribution = os.environ.get('ROS_DISTRO')
    if distribution == 'jazzy':
        return Check('ROS 2', 'ok', f'Jazzy sourced, {middleware}')
    return Check('ROS 2', 'fail', f'{distribution or "none"} sourced and no wheels',
                 'source /opt/ros/jazzy/setup.bash or start through ./run.sh')


def check_profile() -> Check:
    """Check that the loopback profile is in force."""
    if network_is_open():
        return Check('network', 'warn', 'open: ROS traffic may leave this machine',
                     'unset CRGAME_OPEN_NETWORK to keep it here')
    middleware = os.environ.get('RMW_IMPLEMENTATION', 'rmw_fastrtps_cpp')
    if 'fastrtps' not in middleware:
        return Check('network', 'warn', f'{middleware} does not read the loopback profile',
                     'export RMW_IMPLEMENTATION=rmw_fastrtps_cpp')
    profiles = {os.environ[name] for name in PROFILE_VARIABLES if os.environ.get(name)}
    if profiles and all(map(is_loopback_profile, profiles)):
        return Check('network', 'ok', 'loopback only')
    return Check('network', 'warn', f'a profile of your own: {", ".join(map(str, profiles))}',
                 f'unset {" ".join(PROFILE_VARIABLES)} to take the loopback profile')


def check_devices(directory: Path = Path('/dev/input')) -> Check:
    """Check that wheels, game pads and keyboards can be read."""
    devices = sorted(directory.glob('event*'))
    if not devices:
        return Check('input devices', 'warn', f'none in {directory}',
                     'plug in a wheel, or drive with --driver keys:FILE or joy:FILE')
    closed = [device for device in devices if not os.access(device, os.R_OK)]
    if not closed:
        return Check('input devices', 'ok', f'{len(devices)} readable')
    return Check('input devices', 'warn', f'{len(closed)} of {len(devices)} not readable',
                 'sudo usermod -aG input $USER, then log in again')


def check_priority() -> Check:
    """Check that real-time priority can be set, and restore the priority."""
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
    except PermissionError:
        return Check('real-time priority', 'warn', 'not allowed (RLIMIT_RTPRIO)',
                     'add "@realtime - rtprio 98" to /etc/security/limits.conf, join that group '
                     'and log in again; only --realtime-priority needs it')
    os.sched_setscheduler(0, policy, parameters)
    return Check('real-time priority', 'ok', 'allowed')


def check_discovery() -> list[Check]:
    """Check that two ROS processes discover each other and exchange messages."""
    environment = dict(os.environ, ROS_DOMAIN_ID=str(free_domain_id()))
    environment['PYTHONPATH'] = os.pathsep.join(
        [str(Path(__file__).parents[1]), environment.get('PYTHONPATH', '')]).rstrip(os.pathsep)
    command = [sys.executable, '-m', 'crgame_ros.ros.talk_probe']
    with subprocess.Popen([*command, 'talk'], env=environment, stdin=subprocess.PIPE,
                          stderr=subprocess.DEVNULL) as talker:
        try:
            listener = _run([*command, 'listen'], environment)
        finally:
            talker.terminate()
    if listener.returncode != 0:
        return [Check('discovery', 'fail', _last_line(listener.stderr),
                      'look for a firewall on the loopback device, and for a full /dev/shm')]
    found = json.loads(listener.stdout.splitlines()[-1])
    detail = (f'first message after {found["first_s"]:.2f} s, '
              f'then {found["median_us"]:.0f} us a message')
    beyond = ', '.join(found['beyond_loopback'])
    if beyond and not network_is_open():
        ports = Check('ports', 'fail', f'DDS listens at {beyond}',
                      f'unset {" ".join(PROFILE_VARIABLES)}')
    else:
        ports = Check('ports', 'ok', f'DDS listens at {beyond or "loopback only"}')
    return [Check('discovery', 'ok', detail), ports]


def check_disk(runs: Path) -> Check:
    """Check the space for recordings."""
    existing = next(path for path in (runs.absolute(), *runs.absolute().parents) if path.exists())
    free_gb = shutil.disk_usage(existing).free / 1e9
    status: Status = 'ok'
    if free_gb < DISK_WARN_GB:
        status = 'fail' if free_gb < DISK_FAIL_GB else 'warn'
    remedy = '' if status == 'ok' else f'delete old runs in {runs}, or record elsewhere with --out'
    return Check('disk', status, f'{free_gb:.1f} GB free for {runs}', remedy)


def check_processors(devices: Path = Path('/sys/devices/system/cpu')) -> Check:
    """Check the number of processors and their frequency governors."""
    count = len(os.sched_getaffinity(0))
    governors = {path.read_text().strip()
                 for path in devices.glob('cpu[0-9]*/cpufreq/scaling_governor')}
    detail = f'{count}, governor {", ".join(sorted(governors)) or "none (virtual machine)"}'
    if count < 2:
        return Check('processors', 'warn', detail, 'two are needed for an even 100 Hz')
    if governors & {'powersave', 'conservative'}:
        return Check('processors', 'warn', detail, 'sudo cpupower frequency-set -g performance')
    return Check('processors', 'ok', detail)


def check_clock(sleeps: int = JITTER_SLEEPS) -> Check:
    """Measure how late the host wakes a sleep to absolute deadlines."""
    late_ms = []
    deadline = time.monotonic_ns()
    for _ in range(sleeps):
        deadline += JITTER_PERIOD_NS
        time.sleep(max(0, deadline - time.monotonic_ns()) * 1e-9)
        late_ms.append((time.monotonic_ns() - deadline) * 1e-6)
    p99 = statistics.quantiles(late_ms, n=100)[98]
    detail = (f'late by p50 {statistics.median(late_ms):.3f}, p99 {p99:.3f}, '
              f'worst {max(late_ms):.3f} ms')
    if p99 <= JITTER_P99_LIMIT_MS:
        return Check('clock', 'ok', detail)
    return Check('clock', 'warn', detail,
                 'close other programs; a virtual machine may need processors of its own')


def _run(command: list[str],
         environment: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    """Run a command to its end; a time-out is a failure."""
    try:
        return subprocess.run(command, env=environment, capture_output=True, text=True,
                              timeout=PROBE_TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired:
        return subprocess.CompletedProcess(
            command, 1, '', f'no end within {PROBE_TIMEOUT_S:.0f} s')


def _last_line(text: str) -> str:
    """Return the last line that is not empty."""
    return next((line for line in reversed(text.splitlines()) if line.strip()), 'no message')
