# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The checks of `crgame doctor` on this machine and on machines simulated by files."""

from importlib.metadata import PackageNotFoundError, version
import os
from pathlib import Path
import re
import sys

from crgame_ros import doctor
from crgame_ros.doctor import (
    Check,
    check_clock,
    check_devices,
    check_discovery,
    check_disk,
    check_imports,
    check_packages,
    check_priority,
    check_processors,
    check_profile,
    check_python,
    check_ros,
    format_checks,
    PINS,
    PLANNER_PINS,
    read_pins,
)
from crgame_ros.ros.environment import loopback_profile, PROFILE_VARIABLES
from crgame_ros.ros.talk_probe import DISCOVERY_TIMEOUT_S
import pytest


def test_python_of_this_run_is_fit() -> None:
    """The tests run on 3.11 or 3.12, which are the versions that pass."""
    assert check_python().status == 'ok'


def write_pins(folder: Path, pins: str, planners: str = '') -> Path:
    """Write the two files of pins into a folder."""
    (folder / PINS).write_text(pins)
    (folder / PLANNER_PINS).write_text(planners)
    return folder


def test_pins_are_read_without_their_hashes(project_root: Path) -> None:
    pins = {item.name: str(item.specifier) for item in read_pins(project_root)}
    assert pins['commonroad-io'] == '==2024.3'
    assert pins['commonroad-reactive-planner'] == '==2025.1'
    assert 'pytest' not in pins and 'selenium' not in pins


def test_packages_are_compared_with_their_pins(tmp_path: Path) -> None:
    """Another version warns, a missing package fails."""
    folder = write_pins(tmp_path, f'# Made.\nnumpy==0.1 \\\n    --hash=sha256:00\n'
                        f'scipy=={version("scipy")}\nno-such-thing==1\n')
    summary, *checks = check_packages(folder)
    assert [(check.name, check.status) for check in checks] == [
        ('numpy', 'warn'), ('no-such-thing', 'fail')]
    assert summary.detail == '1 as tried, 2 not'
    assert checks[0].remedy == 'pip install --no-deps "numpy==0.1"'
    assert version('numpy') in checks[0].detail


def test_an_installed_package_is_judged_by_what_it_asks_for(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """
    Its metadata, a real dist-info here, counts: ranges, markers, but not the extra `test`.

    The pins count where scripts/env.sh has made the environment.
    """
    info = tmp_path / 'crgame_ros-0.1.0.dist-info'
    info.mkdir()
    (info / 'METADATA').write_text(
        'Metadata-Version: 2.1\nName: crgame_ros\nVersion: 0.1.0\n'
        'Requires-Dist: numpy<9,>=1\nRequires-Dist: scipy<0.2\n'
        'Requires-Dist: no-such-thing; python_version < "3.0"\n'
        'Requires-Dist: selenium-of-nobody; extra == "test"\n')
    monkeypatch.syspath_prepend(str(tmp_path))
    prefix = tmp_path / 'prefix'
    prefix.mkdir()
    monkeypatch.setattr(sys, 'prefix', str(prefix))
    folder = write_pins(tmp_path, 'no-such-pin==1\n')
    summary, *checks = check_packages(folder)
    assert [(check.name, check.status) for check in checks] == [('scipy', 'warn')]
    assert summary.detail == '1 as tried, 1 not'
    (prefix / 'stamp').touch()
    assert [check.name for check in check_packages(folder)[1:]] == ['no-such-pin']


def test_missing_polygon3_is_no_failure(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Only two planners need the package that compiles; any other failure beside it counts."""
    folder = write_pins(tmp_path, '', 'polygon3==3.0.9.1\n')

    def absent(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(doctor, 'version', absent)
    check = check_packages(folder)[1]
    assert (check.name, check.status) == ('polygon3', 'warn')
    assert 'gcc' in check.remedy
    (tmp_path / 'needs_polygon.py').write_text('import sys\n'
                                               'sys.modules["Polygon"] = None\n'
                                               'import commonroad_dc.boundary.boundary\n')
    monkeypatch.setenv('PYTHONPATH', str(tmp_path), prepend=os.pathsep)
    check = check_imports(('json', 'needs_polygon'))
    assert check.status == 'warn'
    assert 'gcc' in check.remedy
    assert check_imports(('no_such_module', 'needs_polygon')).status == 'fail'


def test_planners_that_pip_left_out_are_no_failure(
        monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """On Python 3.12 `pip install` omits two packages: the check names them and the remedy."""
    for name in ('commonroad_rp', 'commonroad_idm_planner'):
        (tmp_path / f'needs_{name}.py').write_text(
            f'import sys\nsys.modules["{name}"] = None\nimport {name}.planner\n')
    monkeypatch.setenv('PYTHONPATH', str(tmp_path), prepend=os.pathsep)
    check = check_imports(('json', 'needs_commonroad_rp', 'needs_commonroad_idm_planner'))
    assert (check.status, 'reactive-package' in check.detail) == ('warn', True)
    assert '--ignore-requires-python' in check.remedy


def test_import_failures_are_named() -> None:
    """A module that doesn't import is named with the reason; the others pass."""
    assert check_imports(('json', 'numpy')).status == 'ok'
    check = check_imports(('json', 'no_such_module'))
    assert (check.status, check.detail) == (
        'fail', "no_such_module: No module named 'no_such_module'")


def test_ros_is_found() -> None:
    """The tests need ROS, so it is found here."""
    assert check_ros().status == 'ok'
    assert 'Jazzy' in check_ros().detail


def test_profile_in_force(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Loopback passes; an open network, another middleware, another profile are reported."""
    assert check_profile().status == 'ok'
    # The same profile from another copy of the package, as installed by colcon or pip.
    other = tmp_path / 'fastdds_loopback.xml'
    other.write_bytes(loopback_profile().read_bytes())
    for name in PROFILE_VARIABLES:
        monkeypatch.setenv(name, str(other))
    assert check_profile().status == 'ok'
    other.write_text('<dds/>')
    assert str(other) in check_profile().detail
    monkeypatch.setenv(PROFILE_VARIABLES[0], '/mine.xml')
    assert '/mine.xml' in check_profile().detail
    monkeypatch.setenv('RMW_IMPLEMENTATION', 'rmw_cyclonedds_cpp')
    assert 'rmw_cyclonedds_cpp' in check_profile().detail
    monkeypatch.setenv('CRGAME_OPEN_NETWORK', '1')
    assert check_profile().detail.startswith('open')


def test_devices(tmp_path: Path) -> None:
    """No device, unreadable devices and readable ones are distinguished."""
    assert check_devices(tmp_path).detail == f'none in {tmp_path}'
    (tmp_path / 'event0').touch()
    assert check_devices(tmp_path) == Check('input devices', 'ok', '1 readable')
    # A dangling link, because root may read anything else.
    (tmp_path / 'event1').symlink_to(tmp_path / 'gone')
    check = check_devices(tmp_path)
    assert (check.status, check.detail) == ('warn', '1 of 2 not readable')
    assert 'input' in check.remedy


def test_priority_is_given_back() -> None:
    """The check leaves this process at the scheduling it had."""
    before = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority
    assert check_priority().status in ('ok', 'warn')
    assert (os.sched_getscheduler(0), os.sched_getparam(0).sched_priority) == before


@pytest.mark.slow
def test_two_processes_discover_each_other() -> None:
    """A message crosses between two real processes, and neither listens beyond loopback."""
    discovery, ports = check_discovery()
    assert discovery.status == 'ok', discovery.detail
    match = re.fullmatch(r'first message after ([\d.]+) s, then (\d+) us a message',
                         discovery.detail)
    assert match is not None
    assert 0.0 < float(match[1]) < DISCOVERY_TIMEOUT_S
    assert int(match[2]) > 0
    assert (ports.status, ports.detail) == ('ok', 'DDS listens at loopback only')


@pytest.mark.slow
def test_ports_beyond_loopback_fail(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A profile without restrictions is found by the sockets it opens."""
    profile = tmp_path / 'open.xml'
    profile.write_text('<?xml version="1.0"?><dds><profiles></profiles></dds>')
    for name in PROFILE_VARIABLES:
        monkeypatch.setenv(name, str(profile))
    _, ports = check_discovery()
    assert ports.status == 'fail'
    assert '0.0.0.0:' in ports.detail


def test_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The space is that of the nearest existing parent; too little warns, none fails."""
    runs = tmp_path / 'not' / 'yet'
    monkeypatch.setattr(doctor, 'DISK_WARN_GB', 0.0)
    assert check_disk(runs).status == 'ok'
    monkeypatch.setattr(doctor, 'DISK_WARN_GB', 1e9)
    assert check_disk(runs).status == 'warn'
    monkeypatch.setattr(doctor, 'DISK_FAIL_GB', 1e9)
    assert check_disk(runs).status == 'fail'


def test_processors(tmp_path: Path) -> None:
    """A governor that saves power causes a warning."""
    assert 'virtual machine' in check_processors(tmp_path).detail
    governor = tmp_path / 'cpu0' / 'cpufreq' / 'scaling_governor'
    governor.parent.mkdir(parents=True)
    governor.write_text('powersave\n')
    check = check_processors(tmp_path)
    assert check.status == 'warn'
    assert 'powersave' in check.detail


def test_clock_measures_lateness() -> None:
    """A sleep never ends before its deadline, so p50 <= p99 and both are positive."""
    p50, p99, worst = map(float, re.findall(r'\d+\.\d+', check_clock(50).detail))
    assert 0.0 < p50 <= p99
    assert worst > 0.0


def test_report_and_exit_code(monkeypatch: pytest.MonkeyPatch,
                              capsys: pytest.CaptureFixture[str]) -> None:
    """Each remedy is under its check; only a failure makes the exit code 1."""
    checks = [Check('one', 'ok', 'fine'), Check('second', 'warn', 'so so', 'mend it')]
    assert format_checks(checks) == ('ok    one     fine\nwarn  second  so so\n'
                                     '              -> mend it\n2 checks: 0 failed, 1 warnings')
    monkeypatch.setattr(doctor, 'run_checks', lambda: checks)
    assert doctor.main() == 0
    checks.append(Check('third', 'fail', 'broken', 'replace it'))
    assert doctor.main() == 1
    assert capsys.readouterr().out.endswith('3 checks: 1 failed, 1 warnings\n')
