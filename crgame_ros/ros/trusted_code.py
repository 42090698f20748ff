# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
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
