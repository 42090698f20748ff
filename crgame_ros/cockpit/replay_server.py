# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`./run.sh --replay BAG`: the page on a recording, without ROS, until a signal stops it."""

import asyncio
from collections.abc import Callable
from pathlib import Path
import signal
import time

from crgame_ros.cockpit.access import Access
from crgame_ros.cockpit.replay_backend import open_replay, ReplayBackend
from crgame_ros.cockpit.server import create_app, listen


def serve_replay(path: Path, host: str = '127.0.0.1', port: int = 8080, token: str | None = None,
                 say: Callable[[str], None] = print) -> int:
    """
    Show a recording in the browser until SIGINT or SIGTERM.

    :param path: as in `ReplayBackend`.
    :param port: the first to try, 0 takes any.
    :param token: token of every client; None creates one if other machines can connect.
    :param say: prints a line.
    :return: exit code 0.
    :raises InputError: if the recording cannot be shown, or no port is free.
    """
    access = Access.guarded(host, port) if token is None else Access(host, port, token)
    backend = open_replay(path, say, time.monotonic)
    asyncio.run(_serve(backend, access, say))
    return 0


async def _serve(backend: ReplayBackend, access: Access, say: Callable[[str], None]) -> None:
    ended = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, ended.set)
    runner, port = await listen(create_app(backend, access, None), access.host, access.port)
    try:
        for notice in backend.notices:
            say(f'note: {notice}')
        say(f'replay of {backend.path}: {access.at_port(port).url}  (Ctrl-C ends it)')
        await ended.wait()
    finally:
        await runner.cleanup()
