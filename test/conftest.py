# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Fixtures of all tests; ROS traffic of every test stays on this machine and in its own domain."""

import os
from pathlib import Path

import pytest

from crgame_ros.ros.environment import free_domain_id, prepare_environment

LONGEST_ID = 100
# Of the tests that start processes, and hold their own against the clock.
GRAPH_FOLDERS = ('live', 'browser', 'ros')
YIELDING_NICE = 15
ROOT = Path(__file__).resolve().parents[1]


def pytest_configure() -> None:
    """Prepare the environment before any test imports rclpy, and inherit it to processes."""
    prepare_environment()
    os.environ.setdefault('ROS_DOMAIN_ID', str(free_domain_id()))
    paths = os.environ.get('PYTHONPATH', '').split(os.pathsep)
    if str(ROOT) not in paths:
        os.environ['PYTHONPATH'] = os.pathsep.join(filter(None, [str(ROOT), *paths]))


# Before xdist reads the groups.
@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """
    Keep tests together that share fixtures, and graphs from each other's processors.

    With `-n 2 --dist loadgroup` one worker runs everything that starts a graph or a browser, which
    mostly waits, and the other one computes.
    """
    for item in items:
        folder = item.path.relative_to(ROOT / 'test').parts[0]
        group = 'graph' if folder in GRAPH_FOLDERS else item.path.stem
        item.add_marker(pytest.mark.xdist_group(group))


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Let a worker that computes give way to the one whose graphs keep to the clock."""
    mark = item.get_closest_marker('xdist_group')
    if 'PYTEST_XDIST_WORKER' in os.environ and mark is not None and mark.args != ('graph',):
        os.setpriority(os.PRIO_PROCESS, 0, max(os.getpriority(os.PRIO_PROCESS, 0), YIELDING_NICE))


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    """Name long values by their length: a line of megabytes chokes whoever reads the output."""
    if isinstance(val, str | bytes) and len(val) > LONGEST_ID:
        return f'{argname} of {len(val)}'
    return None


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
