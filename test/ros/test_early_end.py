# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C while a node still imports ends it like any other time: without a traceback."""

import os
import re
import signal
import subprocess
import sys
import time

import pytest
from ros_domains import own_domain_id


@pytest.mark.parametrize('after_s', [0.1, 0.2, 0.4, 0.8])
def test_ctrl_c_during_imports_is_no_traceback(after_s: float) -> None:
    process = subprocess.Popen(
        [sys.executable, '-m', 'crgame_ros.nodes.planner_node'], stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True,
        env=os.environ | {'ROS_DOMAIN_ID': str(own_domain_id())})
    time.sleep(after_s)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60.0)
    # Before Python has started, the system itself ends the process.
    assert process.returncode in (0, 1, 130, -signal.SIGINT)
    # A line of a traceback, and not of the log: on a busy machine the node may have begun.
    assert not re.search(r'File ".*(planner_node|rclpy)', errors), errors
