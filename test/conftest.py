# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Fixtures of all tests; ROS traffic of every test stays on this machine and in its own domain."""

from collections.abc import Iterator
import gc
import os
from pathlib import Path
import signal
import sys
from typing import Any

from crgame_ros.ros.environment import prepare_environment
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from worker_roles import (  # noqa: E402 - importable from here on
    ALONE,
    group_of,
    in_company,
    keeps_to_the_clock,
    order_of,
    own_domain_id,
    RoleScheduling,
    step_back,
)

LONGEST_ID = 100
ROOT = Path(__file__).resolve().parents[1]


def pytest_configure() -> None:
    """Prepare the environment before any test imports rclpy, and inherit it to processes."""
    prepare_environment()
    # A shell starts what runs in the background deaf to Ctrl-C, and so are its children. In such
    # a process rclpy's own handler now and then fails to wake what waits.
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if 'PYTEST_XDIST_WORKER' in os.environ or 'ROS_DOMAIN_ID' not in os.environ:
        os.environ['ROS_DOMAIN_ID'] = str(own_domain_id())
    paths = os.environ.get('PYTHONPATH', '').split(os.pathsep)
    if str(ROOT) not in paths:
        os.environ['PYTHONPATH'] = os.pathsep.join(filter(None, [str(ROOT), *paths]))


# Before xdist reads the groups.
@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put tests that keep to the clock first, and each file into a group of its own."""
    groups = {item: group_of(item, ROOT / 'test') for item in items}
    items.sort(key=lambda item: order_of(groups[item]))
    for item, group in groups.items():
        if item.get_closest_marker('xdist_group') is None or group == ALONE:
            item.add_marker(pytest.mark.xdist_group(group))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> RoleScheduling | None:
    """With `--dist loadgroup` some workers run graphs and the others compute."""
    return RoleScheduling(config, log) if config.getvalue('dist') == 'loadgroup' else None


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    """Name long values by their length: a line of megabytes chokes whoever reads the output."""
    if isinstance(val, str | bytes) and len(val) > LONGEST_ID:
        return f'{argname} of {len(val)}'
    return None


@pytest.fixture(scope='module', autouse=True)
def _company(request: pytest.FixtureRequest,
             tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep from each other, and from what computes, those that keep to the clock."""
    first = next(item for item in request.session.items if item.path == request.path)
    group = group_of(first, ROOT / 'test')
    own = tmp_path_factory.getbasetemp()
    # Workers have folders beside each other; a session without any has nobody to wait for.
    folder = own.parent if 'PYTEST_XDIST_WORKER' in os.environ else own
    file = folder / 'company.lock'
    if not keeps_to_the_clock(group):
        step_back()
        with in_company(file):
            yield
        return
    # A collection in the heap that all other tests have left stops this process for half a
    # second: whoever drives a vehicle from here would fall silent, and be braked.
    gc.collect()
    gc.freeze()
    with in_company(file, alone=group == ALONE):
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
    """Return the test, and the processes it starts, a ROS domain that nobody else uses."""
    domain = own_domain_id()
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
    return domain
