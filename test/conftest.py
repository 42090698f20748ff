# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Fixtures of all tests; ROS traffic of every test stays on this machine and in its own domain."""

from collections.abc import Iterator
import gc
import os
from pathlib import Path
import signal

import pytest

from crgame_ros.ros.environment import free_domain_id, prepare_environment

LONGEST_ID = 100
# Of tests that speak with running graphs.
REAL_TIME_FOLDERS = ('live', 'browser', 'ros')
ROOT = Path(__file__).resolve().parents[1]


def pytest_configure() -> None:
    """Prepare the environment before any test imports rclpy, and inherit it to processes."""
    prepare_environment()
    # A shell starts what runs in the background deaf to Ctrl-C, and so are its children. In such
    # a process rclpy's own handler now and then fails to wake what waits.
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    os.environ.setdefault('ROS_DOMAIN_ID', str(free_domain_id()))
    paths = os.environ.get('PYTHONPATH', '').split(os.pathsep)
    if str(ROOT) not in paths:
        os.environ['PYTHONPATH'] = os.pathsep.join(filter(None, [str(ROOT), *paths]))


# Before xdist reads the groups.
@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """
    Put tests that keep to the clock last and into one group, the others into one for each file.

    With `--dist loadgroup --no-loadscope-reorder` workers share the tests that compute, and
    when these are done one worker runs the graphs and browsers, alone on the machine.
    """
    items.sort(key=_keeps_to_the_clock)
    for item in items:
        folder = item.path.relative_to(ROOT / 'test').with_suffix('')
        group = 'clock' if _keeps_to_the_clock(item) else str(folder)
        item.add_marker(pytest.mark.xdist_group(group))


def _keeps_to_the_clock(item: pytest.Item) -> bool:
    return item.path.relative_to(ROOT / 'test').parts[0] in REAL_TIME_FOLDERS


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    """Name long values by their length: a line of megabytes chokes whoever reads the output."""
    if isinstance(val, str | bytes) and len(val) > LONGEST_ID:
        return f'{argname} of {len(val)}'
    return None


@pytest.fixture(scope='module', autouse=True)
def _no_long_collections(request: pytest.FixtureRequest) -> Iterator[None]:
    """
    Keep the collector from walking over all that other tests have left.

    In a heap of a gigabyte it stops this process for half a second: whoever drives a vehicle from
    here would fall silent, and be braked.
    """
    if request.path.relative_to(ROOT / 'test').parts[0] not in REAL_TIME_FOLDERS:
        yield
        return
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.fixture(scope='session')
def project_root() -> Path:
    """Return the root of the source tree."""
    return ROOT


@pytest.fixture(scope='session')
def shared_scenarios() -> Path:
    """Return the directory of published scenarios beside the project, or skip."""
    directory = ROOT.parent / 'shared' / 'scenarios'
    if not directory.is_dir():
        pytest.skip(f'no published scenarios at {directory}')
    return directory


@pytest.fixture
def ros_domain(monkeypatch: pytest.MonkeyPatch) -> int:
    """Give the test, and the processes it starts, a ROS domain that nobody else uses."""
    domain = free_domain_id()
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
    return domain
