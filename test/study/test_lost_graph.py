# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What happens while a graph ends, or after its end, is noticed."""

import asyncio
from collections.abc import Callable, Iterator
from pathlib import Path
import sys

from crgame_ros.errors import InputError
from crgame_ros.study.conduct import live_drives
from crgame_ros.study.drive_watch import DrivePhase
from crgame_ros.study.participant_session import ParticipantSession
from crgame_ros.study.session_script import is_driven
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from desk_support import write_study  # noqa: E402, I100


class Killed:
    """A graph whose launcher is killed before its nodes are heard, as their end follows its."""

    was_killed = True

    def __init__(self, meanwhile: Callable[[], None] = lambda: None) -> None:
        self.has_ended = self.is_closed = False
        self._meanwhile = meanwhile

    def end(self) -> None:
        """Take a while."""
        self._meanwhile()
        self.is_closed = True

    def poll(self) -> None:
        """Read nothing; meanwhile the launcher is killed."""
        self.has_ended = True


class Director:
    """What the nodes say."""

    def __init__(self) -> None:
        self.heard = 0

    def poll(self) -> None:
        """Hear that the nodes were asked to end."""
        self.heard += 1

    def close(self) -> None:
        """Hear no more."""


@pytest.fixture
def session(tmp_path: Path) -> Iterator[ParticipantSession]:
    """Return a session with a question and, before it, a trial whose game is not there."""
    study = write_study(tmp_path / 'study', before=[], fields=[], factors=[], blocks=[
        {'name': 'main', 'settings': {'game': 'absent.yaml'}}])
    with ParticipantSession(study, tmp_path / 'P01', 'P01') as opened:
        yield opened


async def until(drives: live_drives.LiveDrives, running: asyncio.Task[None],
                graph: Killed | None) -> None:
    """Wait until the trial cannot be driven, in this graph."""
    async with asyncio.timeout(10.0):
        while drives.riders[0].state.phase is not DrivePhase.FAILED or drives._graph is not graph:
            assert not running.done(), running.exception()
            await asyncio.sleep(0.01)


def test_a_graph_that_is_killed_between_two_looks_is_lost() -> None:
    """Else its drive would be recorded as one that somebody has ended."""
    drives = object.__new__(live_drives.LiveDrives)
    drives._graph, drives._director = Killed(), Director()  # type: ignore[assignment]
    with pytest.raises(live_drives._LostGraphError):
        asyncio.run(drives._poll())


def test_a_graph_that_ends_while_the_experimenter_thinks_is_lost(
        session: ParticipantSession, tmp_path: Path) -> None:
    async def body() -> None:
        drives = live_drives.LiveDrives([session], tmp_path / 'P01', 0)
        graph = drives._graph = Killed()  # type: ignore[assignment]
        drives._director = Director()  # type: ignore[assignment]
        running = asyncio.create_task(drives.run())
        await until(drives, running, None)
        assert graph.is_closed
        running.cancel()
        await asyncio.wait([running])
    asyncio.run(body())


def test_a_repeat_while_the_graph_ends_is_not_forgotten(session: ParticipantSession,
                                                        tmp_path: Path) -> None:
    async def body() -> None:
        drives = live_drives.LiveDrives([session], tmp_path / 'P01', 0)
        session.skip('not now')
        assert not any(is_driven(item) and item.id not in session.done for item in session.items)

        def repeat() -> None:
            session.repeat('main/1', 'now')
            drives.wake()
        drives._graph = Killed(repeat)  # type: ignore[assignment]
        running = asyncio.create_task(drives.run())
        await until(drives, running, None)
        running.cancel()
        await asyncio.wait([running])
    asyncio.run(body())


def test_a_graph_ends_even_if_the_journal_takes_no_more(session: ParticipantSession,
                                                        tmp_path: Path) -> None:
    async def body() -> None:
        drives = live_drives.LiveDrives([session], tmp_path / 'P01', 0)
        graph = drives._graph = Killed()  # type: ignore[assignment]
        drives._set_phase(DrivePhase.DRIVING, 'main/1')
        with Path('/dev/full').open('ab', buffering=0) as session.journal._file, \
                pytest.raises(InputError, match='No space left on device'):
            await drives.close()
        assert graph.is_closed
    asyncio.run(body())
