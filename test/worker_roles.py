# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who of pytest-xdist's workers runs what: graphs first, beside them what computes."""

from collections.abc import Iterator
from contextlib import contextmanager
import fcntl
import os
from pathlib import Path

from crgame_ros.ros.environment import free_domain_id
import pytest
from xdist.scheduler.loadgroup import LoadGroupScheduling
from xdist.workermanage import WorkerController

# Of tests that keep to the clock: they speak with running graphs and servers.
REAL_TIME_FOLDERS = ('live', 'browser', 'ros', 'cockpit')
# These in there do not: they compute, or start what nobody waits for.
TIMELESS = {'cockpit/test_replay_backend', 'cockpit/test_scene', 'ros/test_markers',
            'ros/test_number_parameters', 'ros/test_ros_messages'}
# These elsewhere need an ordinary priority: they ask the kernel about it.
ORDINARY = {'timing/test_time_slice'}
# The group of those that nothing may run beside: they assert what clocks show.
ALONE = 'alone'
GRAPH_WORKERS = 2
MAX_WORKERS = 4
_NAME = os.environ.get('PYTEST_XDIST_WORKER', 'gw0')


def _number(name: str) -> int:
    return int(name.removeprefix('gw'))


def own_domain_id() -> int:
    """Choose a free `ROS_DOMAIN_ID` that no other worker chooses, though it asks now."""
    while (domain := free_domain_id()) % MAX_WORKERS != _number(_NAME) % MAX_WORKERS:
        pass
    return domain


def group_of(item: pytest.Item, folder: Path) -> str:
    """
    Name the group of a test: those that are alone, what its file says it shares, or its file.

    :param folder: of all tests.
    """
    if item.get_closest_marker(ALONE) is not None:
        return ALONE
    shared = item.get_closest_marker('xdist_group')
    return shared.args[0] if shared else str(item.path.relative_to(folder).with_suffix(''))


def keeps_to_the_clock(group: str) -> bool:
    """Return whether the tests of a group may not be slowed: most speak with running graphs."""
    return group == ALONE or group in ORDINARY or (
        group.partition('/')[0] in REAL_TIME_FOLDERS and group not in TIMELESS)


def order_of(group: str) -> int:
    """Return the place of a group: graphs, those that are alone, and what computes."""
    return 1 if group == ALONE else 0 if keeps_to_the_clock(group) else 2


class RoleScheduling(LoadGroupScheduling):
    """
    Gives the first workers graphs while there are any, and the others only what computes.

    The last of the workers always computes. Whoever has once computed gets no graph any more, for
    its priority stays low.
    """

    def _suits(self, node: WorkerController, group: str) -> bool:
        graphs = min(GRAPH_WORKERS, max(1, self.numnodes - 1))
        return _number(node.gateway.id) < graphs or not keeps_to_the_clock(group)

    def _next_group(self, node: WorkerController) -> str | None:
        return next((group for group in self.workqueue if self._suits(node, group)), None)

    def _assign_work_unit(self, node: WorkerController) -> None:
        group = self._next_group(node)
        if group is None:
            node.shutdown()
            return
        self.workqueue.move_to_end(group, last=False)
        super()._assign_work_unit(node)

    def _reschedule(self, node: WorkerController) -> None:
        if self._next_group(node) is None and not node.shutting_down:
            node.shutdown()
            return
        super()._reschedule(node)


def step_back() -> None:
    """
    Let a worker compute, for good, only in what others leave of the processors.

    Whoever wakes up takes the place of an idle task at once.
    """
    if int(os.environ.get('PYTEST_XDIST_WORKER_COUNT', '1')) > 1:
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


@contextmanager
def in_company(file: Path, *, alone: bool = False) -> Iterator[None]:
    """
    Wait until no other worker runs anything, or only until nobody is alone.

    Who wants to be alone gets there last: others don't wait for it while some of them work.

    :param file: that all workers lock.
    """
    with file.open('a') as handle:
        fcntl.flock(handle, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        yield
