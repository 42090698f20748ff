# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Receives a platform's participants, and conducts their sessions in processes of their own."""

import asyncio
from collections.abc import AsyncIterator, Callable
import contextlib
from dataclasses import dataclass
import os
from pathlib import Path
import signal
import sys

from crgame_ros.cockpit.access import Access
from crgame_ros.cockpit.exposure import Exposure, tls_context
from crgame_ros.cockpit.server import listen
from crgame_ros.processes import PARENT_VARIABLE
from crgame_ros.study.data.conducted_study import read_participant
from crgame_ros.study.desk.reception import create_reception_app, Reception
from crgame_ros.study.desk.server import PARTICIPANT
from crgame_ros.study.elsewhere import PlatformIds
from crgame_ros.study.file import StudyFile
from crgame_ros.study.folder import StudyFolder

# Time in which a session prints its link, and in which recordings are finished [s].
LINK_S, END_S = 60.0, 120.0
# A session whose participant has gone leaves its place to another [min].
ABSENT_MIN = 10.0


@dataclass(frozen=True)
class ReceptionRequest:
    """
    The reception to run.

    :param study: with `elsewhere`.
    :param file: of the study.
    :param folder: of its data.
    :param pages: how those of the reception are served; each session takes the next two ports.
    :param capacity: number of sessions at once.
    """

    study: StudyFile
    file: Path
    folder: StudyFolder
    pages: Exposure
    capacity: int

    def pair(self) -> tuple[Path, Path]:
        """Return the files of the certificate of all pages, and of its key."""
        pair = self.pages.pair()
        assert pair is not None
        return pair


class Sessions:
    """
    The sessions that go on at once.

    :param say: prints one line.
    """

    def __init__(self, request: ReceptionRequest, say: Callable[[str], None]) -> None:
        self._request, self._say = request, say
        self._links: dict[str, asyncio.Future[str]] = {}
        self._places: dict[str, int] = {}
        self._processes: dict[str, asyncio.subprocess.Process] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._is_ending = False

    async def receive(self, participant: str) -> Reception:
        """
        Begin the session of a participant who arrives, or go on with it.

        :param participant: id in the study.
        """
        if participant not in self._links:
            folder = self._request.folder.participant(participant)
            record = read_participant(self._request.study, folder)
            if record is not None and record.part != 'under way':
                return Reception(why='done' if record.part == 'completed' else record.part)
            if len(self._links) >= self._request.capacity or self._is_ending:
                return Reception(why='full')
            self._begin(participant)
        link = self._links[participant]
        with contextlib.suppress(TimeoutError):
            return Reception(await asyncio.wait_for(asyncio.shield(link), LINK_S), 'failed')
        return Reception(why='failed')

    async def end(self) -> None:
        """End all sessions in good order."""
        self._is_ending = True
        for process in self._processes.values():
            with contextlib.suppress(ProcessLookupError):
                process.send_signal(signal.SIGINT)
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=END_S)
        for process in self._processes.values():
            with contextlib.suppress(ProcessLookupError):
                process.kill()

    def _begin(self, participant: str) -> None:
        taken = set(self._places.values())
        place = next(each for each in range(self._request.capacity) if each not in taken)
        self._places[participant] = place
        self._links[participant] = asyncio.get_running_loop().create_future()
        task = asyncio.create_task(self._conduct(participant, place))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _command(self, participant: str, place: int) -> list[str]:
        request = self._request
        certificate, key = request.pair()
        return [sys.executable, '-m', 'crgame_ros.cli', 'study', 'run', str(request.file),
                '--participant', participant, '--out', str(request.folder.root),
                '--port', str(request.pages.port + 1 + 2 * place),
                '--listen', request.pages.host,
                '--certificate', str(certificate), '--key', str(key), '--absent', f'{ABSENT_MIN}']

    async def _conduct(self, participant: str, place: int) -> None:
        """Run the process of a session until it ends; its lines are printed with the id."""
        link = self._links[participant]
        try:
            process = await asyncio.create_subprocess_exec(
                *self._command(participant, place), stdin=asyncio.subprocess.DEVNULL,
                stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT,
                env={**os.environ, PARENT_VARIABLE: str(os.getpid())},
                # Ctrl-C goes to the reception only, which ends the sessions.
                start_new_session=True)
            self._processes[participant] = process
            if self._is_ending:
                process.send_signal(signal.SIGINT)
            assert process.stdout is not None
            async for line in _lines(process.stdout):
                text = line.decode('utf-8', 'replace').rstrip()
                if text.startswith(f'{PARTICIPANT}, ') and not link.done():
                    link.set_result(text.split()[-1])
                else:
                    self._say(f'{participant}: {text}')
            await process.wait()
        finally:
            if not link.done():
                link.set_result('')
            self._processes.pop(participant, None)
            del self._links[participant], self._places[participant]


async def _lines(stream: asyncio.StreamReader) -> AsyncIterator[bytes]:
    """Yield the lines of a process, without those that are longer than a reader holds (64 KiB)."""
    while not stream.at_eof():
        with contextlib.suppress(ValueError):
            if line := await stream.readline():
                yield line


async def run_reception(request: ReceptionRequest, say: Callable[[str], None]) -> None:
    """
    Receive participants until the program is ended.

    :param say: prints one line.
    :raises CrgameError: if no certificate or no port can be used.
    """
    elsewhere = request.study.elsewhere
    assert elsewhere is not None
    stop = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        asyncio.get_running_loop().add_signal_handler(number, stop.set)
    ids = PlatformIds.begun(request.folder.root)
    access = Access(request.pages.host, request.pages.port, ids.token,
                    tls_context(*request.pair()))
    sessions = Sessions(request, say)
    runner, port = await listen(
        create_reception_app(request.study, access, ids, sessions.receive), access.host,
        access.port)
    try:
        say(f'address for the platform, which puts its id for ID: {access.at_port(port).url}'
            f'&{elsewhere.id_from}=ID')
        for line in request.pages.certificate_lines():
            say(line)
        say(f'up to {request.capacity} at once; data go to {request.folder.root.resolve()}')
        await stop.wait()
    finally:
        say('ending: recordings are finished')
        await sessions.end()
        await runner.cleanup()
