# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A desk in a process of its own, which tests can end in any way."""

import asyncio
from pathlib import Path
import sys

from crgame_ros.cockpit.access import Access
from crgame_ros.study.desk.desk import Desk
from crgame_ros.study.desk.server import serve_desk
from crgame_ros.study.file import load_study
from crgame_ros.study.participant_session import ParticipantSession

sys.path.insert(0, str(Path(__file__).parent))

from desk_support import DrivesWithoutGraph  # noqa: E402, I100


async def main(study: str, folder: str, port: str, link: str = '', step_s: str = '0.05') -> None:
    """Serve the session in a folder until the process is ended."""
    with ParticipantSession(load_study(Path(study)), Path(folder), 'P07', 0) as session:
        desk = Desk(session, DrivesWithoutGraph(session, link, float(step_s)))
        _, lines = await serve_desk(desk, Access('127.0.0.1', int(port)), Path(folder))
        print('\n'.join(lines), flush=True)
        await asyncio.Event().wait()


if __name__ == '__main__':
    asyncio.run(main(*sys.argv[1:]))
