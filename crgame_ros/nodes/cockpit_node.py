# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""cockpit_node: the page in which people drive, watch and control the run."""

import asyncio
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from crgame_ros.cockpit.exposure import Exposure
from crgame_ros.cockpit.framing_origin import read_origin
from crgame_ros.cockpit.library import Library
from crgame_ros.cockpit.runs.archive import RunArchive
from crgame_ros.cockpit.runs.routes import add_run_routes
from crgame_ros.cockpit.server import create_app, listen
from crgame_ros.nodes.cockpit.backend import LiveBackend
from crgame_ros.paths import scenarios_directory
from crgame_ros.ros.node_main import run_node, StopFlag
from crgame_ros.ros.number_parameters import fixed
from rcl_interfaces.msg import IntegerRange, ParameterDescriptor
from rclpy.node import Node

LOOK_S = 0.05


class CockpitNode(Node):
    """The server of the page and its WebSocket; the simulation never waits for a viewer."""

    def __init__(self) -> None:
        super().__init__('cockpit_node')
        # Removed at the end.
        self._private = ExitStack()
        self._opening = self._declare_exposure()
        self._framed_by = fixed(
            self, 'framed_by', '', 'origins of the only pages that may show this one within them, '
            'such as http://127.0.0.1:8070, with spaces between them; empty: no page may')
        self._seats = fixed(self, 'seats', ['hv0'], 'seats for which open_cockpit makes links')
        self._folders = fixed(self, 'folders', [''],
                              "folders of games and scenarios beside the package's own")
        self._runs = fixed(self, 'runs', '',
                           "folder of the session's files, which the page names; none if empty")
        self._archive = fixed(self, 'archive', '',
                              'folder of other sessions, whose runs the page lists; none if empty')
        self._work = fixed(self, 'directory', 'cockpit', 'folder for uploaded scenarios and for '
                           'the games that people choose')

    def _declare_exposure(self) -> Exposure:
        port: int = self.declare_parameter('port', 8080, ParameterDescriptor(
            description='port of the page; the next free one when it is taken', read_only=True,
            integer_range=[IntegerRange(from_value=1, to_value=65535, step=1)])).value
        certificate = fixed(self, 'certificate', '', 'PEM file for TLS; plain HTTP if empty')
        key = fixed(self, 'key', '', 'PEM file with the key of the certificate')
        return Exposure(
            fixed(self, 'listen', '127.0.0.1', 'address to listen on; beyond this machine '
                  'everybody needs the token of the printed address'), port,
            fixed(self, 'token', False, 'ask for a token on this machine too'),
            fixed(self, 'open_cockpit', False,
                  'let people in by links that let one browser in each, over TLS'),
            Path(certificate) if certificate else None, Path(key) if key else None,
            Path(fixed(self, 'private', '', 'folder that only its owner can read, in which links '
                       'and certificate outlive this node; a new one if empty')
                 or self._private.enter_context(TemporaryDirectory(prefix='crgame_'))))

    def run(self, stop: StopFlag) -> None:
        """Serve until asked to stop."""
        with self._private:
            asyncio.run(self._serve(stop))

    async def _serve(self, stop: StopFlag) -> None:
        folders = [('crgame_ros', scenarios_directory())]
        folders += [(Path(item).name, Path(item)) for item in self._folders if item]
        work = Path(self._work)
        opening = self._opening
        access = opening.access()
        app = create_app(LiveBackend(self, Path(self._runs) if self._runs else None), access,
                         Library(folders, work / 'uploads', work / 'games'),
                         framed_by=' '.join(map(read_origin, self._framed_by.split())))
        if self._runs:
            archive = RunArchive(Path(self._runs), Path(self._archive) if self._archive else None)
            add_run_routes(app, archive, work)
        runner, port = await listen(app, opening.host, opening.port)
        if port != opening.port:
            self.get_logger().warning(f'port {opening.port} is taken')
        for line in opening.lines(access.at_port(port), self._seats):
            print(line, flush=True)
        try:
            while not stop.requested:
                await asyncio.sleep(LOOK_S)
        finally:
            await runner.cleanup()


main = partial(run_node, CockpitNode)

if __name__ == '__main__':
    main()
