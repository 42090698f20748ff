# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A node runs the code that its parameters or a game file name, and no other."""

from collections.abc import Iterator
import json
from pathlib import Path

from crgame_ros.control.tracker import Tracker
from crgame_ros.errors import InputError
from crgame_ros.registry import ModelRegistry
from crgame_ros.ros.trusted_code import TrustedCode
import pytest
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter


@pytest.fixture
def context(ros_domain: int) -> Iterator[rclpy.Context]:
    context = rclpy.Context()
    rclpy.init(context=context)
    yield context
    rclpy.shutdown(context=context)


def test_code_of_a_game_file_or_of_a_parameter_passes(context: rclpy.Context,
                                                      tmp_path: Path) -> None:
    roster = tmp_path / 'roster.json'
    node = Node('loads', context=context, parameter_overrides=[
        Parameter('roster', value=str(roster))])
    code = TrustedCode(node, 'mine.py:Mine')
    for name in ('idm', 'mine.py:Mine'):
        code.check(name, 'planner')
    with pytest.raises(InputError, match='planner other.py:Other: is code that only a message'):
        code.check('other.py:Other', 'planner')
    # sim_node writes the file when it has read a game.
    roster.write_text(json.dumps({'code': ['other.py:Other']}))
    code.check('other.py:Other', 'planner')
    roster.write_text('{')
    with pytest.raises(InputError):
        code.check('other.py:Other', 'planner')


def test_what_one_node_refuses_others_of_its_process_still_load(context: rclpy.Context) -> None:
    code = TrustedCode(Node('loads', context=context))
    name = 'crgame_ros.control.lqr:LqrTracker'
    with pytest.raises(InputError):
        code.check(name, 'tracker')
    trackers = ModelRegistry('trackers', 'tracker', {}, Tracker)
    assert trackers.find(name).__name__ == 'LqrTracker'
