# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The replay of one run beside the cockpit of another: `python -m … BAG`, with a token as a line.

It listens on loopback, prints the port on its standard output, and ends when its standard
input ends, so with the cockpit.
"""

import asyncio
import json
import os
from pathlib import Path
import sys

from crgame_ros.cockpit.access import Access
from crgame_ros.cockpit.replay_backend import ReplayBackend
from crgame_ros.cockpit.server import create_app, listen
from crgame_ros.errors import CrgameError

HOST = '127.0.0.1'
_NICE = 10


def main() -> int:
    """Serve the recording that the command line names."""
    os.nice(_NICE)
    token = sys.stdin.readline().strip()
    try:
        backend = ReplayBackend(Path(sys.argv[1]))
    except CrgameError as error:
        _send({'error': str(error).replace(f'{Path(sys.argv[1]).parent}/', '')})
        return error.exit_code
    asyncio.run(_serve(backend, Access(HOST, 0, token)))
    return 0


async def _serve(backend: ReplayBackend, access: Access) -> None:
    runner, port = await listen(create_app(backend, access, None), HOST, 0)
    _send({'port': port})
    try:
        await asyncio.to_thread(sys.stdin.read)
    finally:
        await runner.cleanup()


def _send(content: dict[str, object]) -> None:
    print(json.dumps(content), flush=True)


if __name__ == '__main__':
    sys.exit(main())
