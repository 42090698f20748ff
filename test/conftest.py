# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Fixtures and tiers of all tests; ROS traffic is local, and each test has its own domain."""

import gc
import os
from pathlib import Path
import signal
import sys
import zlib

from crgame_ros.ros.environment import prepare_environment
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from ros_domains import own_domain_id  # noqa: E402 - importable from here on

LONGEST_ID = 100
ROOT = Path(__file__).resolve().parents[1]
# Their tests start ROS graphs, servers or browsers.
GRAPH_FOLDERS = ('live', 'browser', 'ros', 'cockpit')
# Published scenarios beside the project; tests that need them skip where they are absent.
PUBLISHED = ROOT.parent / 'shared' / 'scenarios'
TIERS = ('quick', 'default', 'all')


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare the tier."""
    parser.addoption('--tier', choices=TIERS, default='all', help=(
        'quick: no ROS graph, no browser; default: what decides whether a change lands; all: '
        'also the tests marked exhaustive or clock, and every case of those marked matrix'))


def pytest_configure() -> None:
    """Prepare the environment before any test imports rclpy, and inherit it to processes."""
    prepare_environment()
    # A shell starts background processes with Ctrl-C ignored, and their children inherit this. In
    # such a process rclpy's own handler sometimes fails to wake waiting calls.
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if 'PYTEST_XDIST_WORKER' in os.environ or 'ROS_DOMAIN_ID' not in os.environ:
        os.environ['ROS_DOMAIN_ID'] = str(own_domain_id())
    paths = os.environ.get('PYTHONPATH', '').split(os.pathsep)
    if str(ROOT) not in paths:
        os.environ['PYTHONPATH'] = os.pathsep.join(filter(None, [str(ROOT), *paths]))


# Before xdist reads the groups.
@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """
    Leave out tests of other tiers, and give each file to one worker.

    Files are in the order of a digest of their names, which mixes folders: few graphs run at the
    same time.
    """
    tier = config.getoption('--tier')
    kept, left_out, cases = [], [], dict[str, set[str]]()
    for item in items:
        if item.path.relative_to(ROOT / 'test').parts[0] in GRAPH_FOLDERS:
            item.add_marker(pytest.mark.graph)
        test, _, case = item.nodeid.removesuffix(']').partition('[')
        (kept if _is_in(item, tier, case, is_first=test not in cases) else left_out).append(item)
        cases.setdefault(test, set()).add(case)
    if PUBLISHED.is_dir() and not any('::' in path for path in config.args):
        _check_named_cases(items, cases)
    if left_out:
        config.hook.pytest_deselected(items=left_out)
    items[:] = sorted(kept, key=lambda item: zlib.crc32(_file_of(item).encode()))
    for item in items:
        if item.get_closest_marker('xdist_group') is None:
            item.add_marker(pytest.mark.xdist_group(_file_of(item)))


def pytest_collection_finish() -> None:
    """Let no garbage collection search the modules and tests, which stay to the end."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000)


def _file_of(item: pytest.Item) -> str:
    return item.nodeid.partition('::')[0]


def _is_in(item: pytest.Item, tier: str, case: str, is_first: bool) -> bool:
    if tier == 'all':
        return True
    marked = {mark.name for mark in item.iter_markers()}
    if {'exhaustive', 'clock'} & marked:
        return False
    matrix = item.get_closest_marker('matrix')
    if matrix and not (case in matrix.args if matrix.args else is_first):
        # A matrix without cases is skipped, and says so.
        return item.get_closest_marker('skip') is not None
    return tier == 'default' or not {'graph', 'slow'} & marked


def _check_named_cases(items: list[pytest.Item], cases: dict[str, set[str]]) -> None:
    """Raise an error if `matrix` names a case that its test does not have."""
    for item in items:
        matrix, test = item.get_closest_marker('matrix'), item.nodeid.partition('[')[0]
        for case in matrix.args if matrix else ():
            if case not in cases[test]:
                raise pytest.UsageError(f'{test} has no case {case}')


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    """Name long values by their length: a line of megabytes cannot be read."""
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
    if not PUBLISHED.is_dir():
        pytest.skip(f'no published scenarios at {PUBLISHED}')
    return PUBLISHED


@pytest.fixture
def ros_domain(monkeypatch: pytest.MonkeyPatch) -> int:
    """Set a ROS domain of its own for the test and the processes that it starts."""
    domain = own_domain_id()
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
    return domain
