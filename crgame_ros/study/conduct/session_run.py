# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Conducts a participant's session: pages, drives, and an orderly end."""

import asyncio
from collections.abc import Callable, Mapping, Sequence
import contextlib
from dataclasses import dataclass, replace
import math
from pathlib import Path
import signal
from urllib.parse import urlsplit

from aiohttp import web
from crgame_ros.cockpit.exposure import Exposure
from crgame_ros.software import software_with_commit
from crgame_ros.study.conduct.live_drives import LiveDrives
from crgame_ros.study.desk.desk import Desk
from crgame_ros.study.desk.server import serve_desk
from crgame_ros.study.elsewhere import private_folder
from crgame_ros.study.file import StudyFile
from crgame_ros.study.participant_session import ParticipantSession

# From "I am ready" to the first cycle [s].
COUNTDOWN_S = 2.0
# Time in which pages show the end and the experimenter may still add a note [s].
LINGER_S = 5.0


@dataclass(frozen=True)
class SessionRequest:
    """
    The session to conduct: of one participant, or of those who drive together.

    :param study: its study.
    :param folders: of the participants, by their anonymous ids, in the order of their seats.
    :param pages: how the first participant's pages are served, but for the private folder; those
        of others, and the cockpit, take later ports.
    :param place: among all participants, from 0 on; by default the next free one.
    :param group: that the experimenter gives.
    :param absent_s: ends the program if no page of the participant is heard for so long [s]
    """

    study: StudyFile
    folders: Mapping[str, Path]
    pages: Exposure
    place: int | None = None
    group: str | None = None
    absent_s: float = math.inf

    @property
    def names(self) -> str:
        """Return the ids of the participants in one text."""
        return ' and '.join(self.folders)


def conduct(request: SessionRequest, say: Callable[[str], None]) -> bool:
    """
    Conduct a session until it is over or the program is ended; the next call resumes it.

    :param say: prints one line.
    :return: whether the session is over.
    :raises CrgameError: if it cannot begin, or another process has a participant's session.
    """
    with contextlib.ExitStack() as opened:
        sessions: list[ParticipantSession] = []
        for participant, folder in request.folders.items():
            # Those who drive together have the same orders.
            session = opened.enter_context(ParticipantSession(
                request.study, folder, participant,
                sessions[0].place if sessions else request.place, group=request.group,
                members=tuple(request.folders) if len(request.folders) > 1 else ()))
            sessions.append(session)
            say(f'{participant}, place {session.place + 1} of {request.study.name}; data go '
                f'to {folder}')
        first, *partners = sessions
        if partners:
            first.join(partners)
        if _are_over(sessions):
            say(f'{request.names} {"are" if partners else "is"} done: nothing is left')
            return True
        for session in sessions:
            session.note_software(software_with_commit())
        asyncio.run(_conduct(sessions, request, say))
        return _are_over(sessions)


def _are_over(sessions: Sequence[ParticipantSession]) -> bool:
    return all(session.next_item is None for session in sessions)


async def _conduct(sessions: Sequence[ParticipantSession], request: SessionRequest,
                   say: Callable[[str], None]) -> None:
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        loop.add_signal_handler(number, stop.set)
    origins: list[str] = []
    private = [private_folder(folder) for folder in request.folders.values()]
    exposures = [replace(request.pages, port=request.pages.port + number, private=path)
                 for number, path in enumerate(private)]
    pair = exposures[0].pair()
    opened = [] if pair is None else [
        '--open-cockpit', '--listen', exposures[0].host, '--certificate', str(pair[0]),
        '--key', str(pair[1])]
    drives = LiveDrives(
        sessions, next(iter(request.folders.values())), request.pages.port + len(sessions),
        lambda: ['--countdown', str(COUNTDOWN_S), *opened,
                 *(f'--framed-by={origin}' for origin in origins)],
        None if pair is None else pair[0])
    desks = [Desk(rider.session, rider) for rider in drives.riders]
    runners: list[web.AppRunner] = []
    driving: asyncio.Task[None] | None = None
    try:
        for desk, exposure, path in zip(desks, exposures, private, strict=True):
            runner, lines = await serve_desk(desk, exposure.access(), path)
            runners.append(runner)
            for line in (*lines, *exposure.certificate_lines()):
                say(line if len(desks) == 1 else f'{desk.session.participant}: {line}')
            address = urlsplit(lines[0].split()[-1])
            origins.append(f'{address.scheme}://{address.netloc}')
        driving = asyncio.create_task(drives.run())
        absent = await _until_over(desks, driving, stop, request.absent_s)
        if absent:
            say(f'no page of {absent} for {request.absent_s / 60.0:g} min')
    finally:
        if driving is not None:
            driving.cancel()
            # Its error, if it ended with one, is on its way already.
            await asyncio.wait([driving])
        say('ending: recordings are finished')
        try:
            await drives.close()
        finally:
            for runner in runners:
                await runner.cleanup()


async def _until_over(desks: Sequence[Desk], driving: asyncio.Task[None], stop: asyncio.Event,
                      absent_s: float) -> str:
    """
    Wait for the last item, or for the end of the program.

    :param absent_s: do not wait any longer for a participant whose page is silent [s].
    :return: the id of that participant; empty if all were there.
    """
    while not stop.is_set():
        under_way = [desk for desk in desks if desk.session.next_item is not None]
        if not under_way:
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(stop.wait(), LINGER_S)
            break
        for desk in under_way:
            if desk.clock_s() - desk.heard_s > absent_s:
                return desk.session.participant
        if driving.done() and driving.exception() is not None:
            # An error that no page can fix.
            driving.result()
        await asyncio.sleep(0.1)
    return ''
