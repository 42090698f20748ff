# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which code a node may run: what its own parameters name, or a game file that was read."""

import json
from pathlib import Path

from crgame_ros.registry import ModelRegistry
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node


def trust_code(node: Node, *named: str) -> None:
    """
    Declare the parameter `roster`, and run no code that messages alone name.

    :param named: what the node's own parameters name.
    """
    roster: str = node.declare_parameter('roster', '', ParameterDescriptor(
        description='file in which sim_node lists the code that the game files which it has read '
        'name; what only a message names is not run', read_only=True)).value

    def is_trusted(name: str) -> bool:
        if name in named:
            return True
        try:
            code = json.loads(Path(roster).read_text(encoding='utf-8'))['code'] if roster else []
        except (OSError, ValueError, KeyError):
            return False
        return name in code

    ModelRegistry.judges.append(is_trusted)
