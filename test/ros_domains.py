# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""ROS domains of tests: workers of pytest-xdist have different ones."""

import os

from crgame_ros.ros.environment import free_domain_id

MAX_WORKERS = 4
_WORKER = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0').removeprefix('gw'))


def own_domain_id() -> int:
    """Choose a free `ROS_DOMAIN_ID` that no other worker chooses, even at the same moment."""
    while (domain := free_domain_id()) % MAX_WORKERS != _WORKER % MAX_WORKERS:
        pass
    return domain
