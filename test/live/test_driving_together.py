# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Two participants and the experimenter in the same drives, in the live graph."""

import asyncio
from collections.abc import Iterator
import os
from pathlib import Path
import signal
import threading
from typing import Any

from crgame_ros.analysis.runs.run import Run
from crgame_ros.paths import scenarios_directory
from crgame_ros.schema.reading import read
from crgame_ros.study.conduct.live_drives import LiveDrives
from crgame_ros.study.drive_watch import DrivePhase
from crgame_ros.study.file import StudyFile
from crgame_ros.study.participant_session import ParticipantSession
from crgame_ros.study.session_journal import read_journal
from live_support import wait_until
from page_client import PageClient
import pytest
import yaml

pytestmark = pytest.mark.exhaustive

PEOPLE = {'P01': 'hv0', 'P02': 'hv1'}
# The experimenter's.
OTHER = 'hv2'


class Crew:
    """Their sessions, which go on in a thread, and a page for each of the three."""

    def __init__(self, folder: Path) -> None:
        game = folder / 'game.yaml'
        game.write_text(yaml.safe_dump({
            'scenario': str(scenarios_directory() / 'ZAM_DenseMerge-1_1_T-1.xml'),
            'humans': [{'id': seat, 'driver': 'cockpit', 'spawn': {
                'lanelet': 51, 's': 255.0 - 40.0 * number, 'd': 0.0, 'speed': 12.0}}
                for number, seat in enumerate((*PEOPLE.values(), OTHER))],
            'avs': [{'id': 'av0', 'planning_problem': 100, 'planner': 'constant-velocity'}]}))
        study = read(StudyFile, {
            'name': 'together', 'settings': {'game': str(game), 'duration': 3.0,
                                             'seats': list(PEOPLE.values()), 'confederate': OTHER},
            'blocks': [{'name': 'main', 'repetitions': 2}]}, 'study')
        self.folders = {name: folder / 'participants' / name for name in PEOPLE}
        self.sessions = [ParticipantSession(study, path, name, 0, members=tuple(PEOPLE))
                         for name, path in self.folders.items()]
        self.sessions[0].join(self.sessions[1:])
        self.loop = asyncio.new_event_loop()
        self.drives = LiveDrives(self.sessions, self.folders['P01'], 8155,
                                 lambda: ['--countdown', '0.2'])
        self._thread = threading.Thread(target=self.loop.run_until_complete, args=(self._run(),))
        self._pages: dict[str, PageClient] = {}

    async def _run(self) -> None:
        self._task = asyncio.create_task(self.drives.run())
        try:
            await self._task
        except asyncio.CancelledError:
            await self.drives.close()

    def __enter__(self) -> 'Crew':
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        for page in self._pages.values():
            page.close()
        self.loop.call_soon_threadsafe(self._task.cancel)
        self._thread.join(90.0)
        for session in self.sessions:
            session.journal.close()
        assert not self._thread.is_alive()

    def are(self, phase: DrivePhase, item: str) -> bool:
        """Return whether the drive is in a phase for both participants."""
        return all((rider.state.phase, rider.state.item) == (phase, item)
                   for rider in self.drives.riders)

    def sit(self, item: str) -> None:
        """Wait for a drive, and take all three seats in it."""
        wait_until(lambda: self.are(DrivePhase.READY, item), f'{item} to be ready')
        graph = self.drives._graph
        assert graph is not None
        for seat in (*PEOPLE.values(), OTHER):
            page = self._pages.get(seat)
            if page is None or page.closed or page.page != graph.cockpit:
                page = self._pages[seat] = PageClient(graph.cockpit)
            wait_until(lambda page=page, seat=seat: page.request(
                'claim', seat=seat, device='')['ok'], f'the seat {seat}')
            page.hold_keys(seat, [1, 0, 0, 0])

    def ready(self, number: int, item: str) -> None:
        """Let a participant say so."""
        self.loop.call_soon_threadsafe(self.drives.riders[number].ready, item)


@pytest.fixture(scope='module')
def journals(tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[list[dict[str, Any]]]]:
    """Drive twice; the graph is killed in the first drive."""
    with Crew(tmp_path_factory.mktemp('crew')) as crew:
        crew.sit('main/1')
        crew.ready(1, 'main/1')
        wait_until(lambda: crew.drives.riders[1].state.awaits_others, 'the second to wait')
        assert crew.are(DrivePhase.READY, 'main/1')
        assert not crew.drives.riders[0].state.awaits_others
        crew.ready(0, 'main/1')
        wait_until(lambda: crew.are(DrivePhase.DRIVING, 'main/1'), 'the drive')
        graph = crew.drives._graph
        assert graph is not None
        os.kill(graph.pid, signal.SIGKILL)
        for item in ('main/1', 'main/2'):
            crew.sit(item)
            for number in range(2):
                crew.ready(number, item)
            wait_until(lambda item=item: all(item in session.done for session in crew.sessions),
                       f'the end of {item}')
        wait_until(lambda: crew.are(DrivePhase.NONE, ''), 'the graph to end')
        crew._thread.join(90.0)
        yield [read_journal(folder) for folder in crew.folders.values()]


def test_both_journals_tell_of_the_same_drives(journals: list[list[dict[str, Any]]]) -> None:
    told = [[(entry['entry'], entry['item'], entry.get('attempt'), entry.get('run'))
             for entry in journal if 'item' in entry] for journal in journals]
    assert told[0] == told[1]
    assert [kind for kind, item, _, _ in told[0] if item == 'main/1'] == [
        'started', 'aborted', 'started', 'finished']


def test_each_run_has_three_drivers(journals: list[list[dict[str, Any]]],
                                    tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = next(tmp_path_factory.getbasetemp().glob('crew*')) / 'participants'
    runs = [entry['run'] for entry in journals[1] if entry['entry'] == 'finished']
    assert len(set(runs)) == 2 and not (folder / 'P02' / 'runs').exists()
    for name in runs:
        run = Run.of_recording(folder / 'P01' / name)
        assert {human.id: human.driver for human in run.game.humans} \
            == dict.fromkeys((*PEOPLE.values(), OTHER), 'cockpit')
        assert {item.spell.seat for item in run.record.drivers} >= {*PEOPLE.values(), OTHER}
