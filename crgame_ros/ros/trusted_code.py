# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The code that a node may run: what its own parameters name, and what the game files name."""

import json
from pathlib import Path

from crgame_ros.errors import InputError
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node


class TrustedCode:
    """
    Refuses code that only a message names; each node checks a name before it is loaded.

    Declares the parameter `roster`.

    :param node: the node that loads code.
    :param named: what the node's own parameters name.
    """

    def __init__(self, node: Node, *named: str) -> None:
        roster: str = node.declare_parameter('roster', '', ParameterDescriptor(
            description='file in which sim_node lists the code that the game files which it has '
            'read name; what only a message names is not run', read_only=True)).value
        self._roster = Path(roster) if roster else None
        self._named = named

    def check(self, name: str, where: str) -> None:
        """
        Let a name pass that is no code, such as `idm`, or code that is trusted.

        :param name: of a planner, sensor, driver or model: `module:Class`, `FILE.py:Class` and
            `policy:FILE.py:load` are code.
        :param where: what is to run it, for messages.
        :raises InputError: if it is code that neither the node nor a game file names.
        """
        if ':' in name and name not in self._named and name not in self._listed():
            raise InputError('is code that only a message names: it is not run',
                             f'{where} {name}',
                             'name it in the game file, or to the node that runs it')

    def _listed(self) -> tuple[str, ...]:
        # Read each time: sim_node writes it anew for each game.
        try:
            return tuple(json.loads(self._roster.read_text(encoding='utf-8'))['code']
                         if self._roster else ())
        except (OSError, ValueError, KeyError):
            return ()
