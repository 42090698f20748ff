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
"""cockpit_node: the page in which people drive, see everything and steer the run."""

import asyncio
from pathlib import Path

from crgame_ros.cockpit.access import Access
from crgame_ros.cockpit.library import Library
from crgame_ros.cockpit.runs.run_archive import RunArchive
from crgame_ros.cockpit.runs.run_routes import add_run_routes
from crgame_ros.cockpit.server import create_app, listen
from crgame_ros.nodes.cockpit.cockpit_backend import LiveBackend
from crgame_ros.paths import scenarios_directory
from crgame_ros.ros.node_main import run_node, StopFlag
from rcl_interfaces.msg import IntegerRange, ParameterDescriptor
from rclpy.node import Node

LOOK_S = 0.05


class CockpitNode(Node):
    """Serves the page and its WebSocket; the simulation never waits for a viewer."""

    def __init__(self) -> None:
        super().__init__('cockpit_node')
        declare = self.declare_parameter
        self._port: int = declare('port', 8080, ParameterDescriptor(
            description='port of the page; the next free one when it is taken', read_only=True,
            integer_range=[IntegerRange(from_value=1, to_value=65535, step=1)])).value
        self._host: str = declare('listen', '127.0.0.1', ParameterDescriptor(
            description='address to listen on; beyond this machine everybody needs the token of '
            'the printed address', read_only=True)).value
        self._folders: list[str] = declare('folders', [''], ParameterDescriptor(
            description="folders of games and scenarios beside the package's own",
            read_only=True)).value
        self._runs: str = declare('runs', '', ParameterDescriptor(
            description="folder of the session's files, which the page names; none if empty",
            read_only=True)).value
        self._archive: str = declare('archive', '', ParameterDescriptor(
            description='folder of other sessions, whose runs the page lists; none if empty',
            read_only=True)).value
        self._work: str = declare('directory', 'cockpit', ParameterDescriptor(
            description='folder for uploaded scenarios and for the games that people choose',
            read_only=True)).value

    def run(self, stop: StopFlag) -> None:
        """Serve until asked to stop."""
        asyncio.run(self._serve(stop))

    async def _serve(self, stop: StopFlag) -> None:
        folders = [('crgame_ros', scenarios_directory())]
        folders += [(Path(item).name, Path(item)) for item in self._folders if item]
        work = Path(self._work)
        access = Access.guarded(self._host, self._port)
        app = create_app(LiveBackend(self, Path(self._runs) if self._runs else None), access,
                         Library(folders, work / 'uploads', work / 'games'))
        if self._runs:
            archive = RunArchive(Path(self._runs), Path(self._archive) if self._archive else None)
            add_run_routes(app, archive, work)
        runner, port = await listen(app, self._host, self._port)
        if port != self._port:
            self.get_logger().warning(f'port {self._port} is taken')
        print(f'the cockpit is at {access.at_port(port).url}', flush=True)
        try:
            while not stop.requested:
                await asyncio.sleep(LOOK_S)
        finally:
            await runner.cleanup()


def main(args: list[str] | None = None) -> None:
    """Run the node."""
    run_node(CockpitNode, args)


if __name__ == '__main__':
    main()
