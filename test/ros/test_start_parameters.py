# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A misspelt parameter at the start of a node is refused, instead of being ignored."""

import os
import subprocess
import sys

import pytest


@pytest.mark.parametrize(('node', 'given', 'line'), [
    ('sim_node', 'gam:=merge',
     'error: command line: there is no parameter "gam"; there are at_end'),
    ('sim_node', 'at_end:=never',
     'error: parameter at_end: is "never"; give exit, stay, stay-if-chosen'),
    ('recorder_node', 'folder:=x', 'error: command line: there is no parameter "folder"; there '
     'are directory'),
    ('driver_node', 'qos_overrides./x.publisher.depth:=5 -p vehicel:=hv1',
     'error: command line: there is no parameter "vehicel"; there are joy_map'),
    ('timesync_node', 'use_sim_time:=true --foo',
     "error: command line: ROS refuses it: ['--foo']"),
])
def test_a_wrong_parameter_is_refused_in_one_line(node: str, given: str, line: str,
                                                  ros_domain: int) -> None:
    done = subprocess.run(
        [sys.executable, '-m', f'crgame_ros.nodes.{node}', '--ros-args', '-p', *given.split()],
        env=os.environ | {'ROS_DOMAIN_ID': str(ros_domain)}, capture_output=True, text=True,
        timeout=120, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith(line)
    assert len(done.stderr.splitlines()) == 1
