# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Conducts a participant's session: pages, drives, and an orderly end."""

import asyncio
from collections.abc import Callable
import contextlib
from dataclasses import dataclass
import math
from pathlib import Path
import signal
from urllib.parse import urlsplit

from crgame_ros.cockpit.exposure import Exposure
from crgame_ros.software import software_with_commit
from crgame_ros.study.conduct.live_drives import LiveDrives
from crgame_ros.study.desk.desk import Desk
from crgame_ros.study.desk.server import serve_desk
from crgame_ros.study.file import StudyFile
from crgame_ros.study.participant_session import ParticipantSession

HOST = '127.0.0.1'
# From "I am ready" to the first cycle [s].
COUNTDOWN_S = 2.0
# Time in which pages show the end and the experimenter may still add a note [s].
LINGER_S = 5.0


@dataclass(frozen=True)
class SessionRequest:
    """
    The session to conduct.

    :param study: its study.
    :param folder: of the participant.
    :param participant: anonymous id.
    :param port: of the pages; the cockpit takes a later one.
    :param place: among all participants, from 0 on; by default the next free one.
    :param group: that the experimenter gives.
    :param listen: address at which other machines get the pages, by links over TLS; None serves
        this machine alone.
    :param certificate: PEM file; None makes one.
    :param key: of the certificate.
    :param absent_s: ends the program if no page of the participant is heard for so long [s]
    """

    study: StudyFile
    folder: Path
    participant: str
    port: int
    place: int | None = None
    group: str | None = None
    listen: str | None = None
    certificate: Path | None = None
    key: Path | None = None
    absent_s: float = math.inf

    def exposure(self, private: Path) -> Exposure:
        """
        Return how the pages are served.

        :param private: folder of links and certificate.
        """
        return Exposure(self.listen or HOST, self.port, links=self.listen is not None,
                        certificate=self.certificate, key=self.key, private=private)


def conduct(request: SessionRequest, say: Callable[[str], None]) -> bool:
    """
    Conduct a session until it is over or the program is ended; the next call resumes it.

    :param say: prints one line.
    :return: whether the session is over.
    :raises CrgameError: if it cannot begin, or another process has the participant's session.
    """
    with ParticipantSession(request.study, request.folder, request.participant,
                            request.place, group=request.group) as session:
        say(f'{request.participant}, place {session.place + 1} of {request.study.name}; data go '
            f'to {request.folder}')
        if session.next_item is None:
            say(f'{request.participant} is done: nothing is left')
            return True
        session.note_software(software_with_commit())
        asyncio.run(_conduct(session, request, say))
        return session.next_item is None


async def _conduct(session: ParticipantSession, request: SessionRequest,
                   say: Callable[[str], None]) -> None:
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        loop.add_signal_handler(number, stop.set)
    origin: list[str] = []
    private = request.folder / '.private'
    private.mkdir(parents=True, exist_ok=True, mode=0o700)
    exposure = request.exposure(private)
    pair = exposure.pair()
    opened = [] if pair is None else [
        '--open-cockpit', '--listen', exposure.host, '--certificate', str(pair[0]),
        '--key', str(pair[1])]
    drives = LiveDrives(session, request.folder, lambda: desk.language, request.port + 1,
                        lambda: ['--countdown', str(COUNTDOWN_S), *opened, '--framed-by', *origin],
                        None if pair is None else pair[0])
    desk = Desk(session, drives)
    runner, lines = await serve_desk(desk, exposure.access(), private)
    driving: asyncio.Task[None] | None = None
    try:
        for line in (*lines, *exposure.certificate_lines()):
            say(line)
        address = urlsplit(lines[0].split()[-1])
        origin.append(f'{address.scheme}://{address.netloc}')
        driving = asyncio.create_task(drives.run())
        if not await _until_over(desk, driving, stop, request.absent_s):
            say(f'no page of {request.participant} for {request.absent_s / 60.0:g} min')
    finally:
        if driving is not None:
            driving.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await driving
        say('ending: recordings are finished')
        await drives.close()
        await runner.cleanup()


async def _until_over(desk: Desk, driving: asyncio.Task[None], stop: asyncio.Event,
                      absent_s: float) -> bool:
    """
    Wait for the last item, or for the end of the program.

    :param absent_s: do not wait any longer for a participant whose page is silent [s].
    :return: whether the participant was there.
    """
    stopped = asyncio.create_task(stop.wait())
    try:
        while not stop.is_set() and desk.session.next_item is not None:
            if desk.clock_s() - desk.heard_s > absent_s:
                return False
            if driving.done() and driving.exception() is not None:
                # An error that no page can fix.
                driving.result()
            await asyncio.sleep(0.1)
        if not stop.is_set():
            await asyncio.wait([stopped], timeout=LINGER_S)
        return True
    finally:
        stopped.cancel()
