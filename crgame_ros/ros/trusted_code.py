# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The code that a node may run: that named by its own parameters and by the game files."""

import json
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.ros.number_parameters import fixed
from rclpy.node import Node


class TrustedCode:
    """
    The check against code that only a message names; each node makes it before it loads code.

    It declares the parameter `roster`.

    :param named: the names in the node's own parameters.
    """

    def __init__(self, node: Node, *named: str) -> None:
        roster = fixed(node, 'roster', '', 'file in which sim_node lists the code that game files '
                       'name; code that only a message names is not run')
        self._roster = Path(roster) if roster else None
        self._named = named

    def check(self, name: str, where: str) -> None:
        """
        Check that a name is no code, such as `idm`, or trusted code.

        :param name: of a planner, sensor, driver or model: `module:Class`, `FILE.py:Class` and
            `policy:FILE.py:load` are code.
        :param where: the part that is to run it, for messages.
        :raises InputError: if it is code that neither the node's parameters nor a game file names.
        """
        if ':' in name and name not in self._named and name not in self._listed():
            raise InputError('is code that only a message names: it is not run',
                             f'{where} {name}',
                             'name it in the game file or in a parameter of the node')

    def _listed(self) -> tuple[str, ...]:
        # Read each time, because sim_node rewrites it for each game.
        try:
            return tuple(json.loads(self._roster.read_text(encoding='utf-8'))['code']
                         if self._roster else ())
        except (OSError, ValueError, KeyError):
            return ()
