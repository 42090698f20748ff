# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Trials in the live graph: each is complete or repeated, whatever process is killed."""

import asyncio
from collections.abc import Iterator
import os
from pathlib import Path
import signal
import threading
import time
from typing import Any

from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.run_folder import recording_in
from crgame_ros.recording.run_trajectories import read_trajectories
from crgame_ros.schema.reading import read
from crgame_ros.study.conduct.live_drives import LiveDrives
from crgame_ros.study.drive_watch import DrivePhase
from crgame_ros.study.file import StudyFile
from crgame_ros.study.participant_session import ParticipantSession
from crgame_ros.study.session_journal import read_journal
from live_support import is_node, wait_until
from page_client import PageClient
import pytest

pytestmark = pytest.mark.exhaustive

DURATION_S = 2.5
# The least real-time factor: a drive that is to be interrupted must not end before.
SLOWEST = 0.1


class Participant:
    """
    A session that goes on in a thread, and a participant that drives in it.

    :param block: keys of the block of trials.
    """

    def __init__(self, folder: Path, **block: Any) -> None:
        settings = {'duration': DURATION_S, 'game': str(scenarios_directory() / 'cut_in.yaml')}
        merge = {'name': 'merge', 'game': str(scenarios_directory() / 'merge.yaml')}
        study = read(StudyFile, {
            'name': 'demo', 'settings': settings,
            'factors': [{'name': 'scene', 'levels': [
                {'name': 'cut-in', 'planner': 'idm'}, merge]}],
            'blocks': [{'name': 'main', **(block or {'order': 'given', 'repetitions': 2})}]},
            'study')
        self.folder = folder
        self.session = ParticipantSession(study, folder, 'P01', 0)
        self.loop = asyncio.new_event_loop()
        self.drives = LiveDrives([self.session], folder, 8150, lambda: ['--countdown', '0.2'])
        self.rider = self.drives.riders[0]
        self._thread = threading.Thread(target=self.loop.run_until_complete, args=(self._run(),))
        self._page: PageClient | None = None
        self.graphs: list[int] = []

    async def _run(self) -> None:
        self._task = asyncio.create_task(self.drives.run())
        try:
            await self._task
        except asyncio.CancelledError:
            await self.drives.close()

    def __enter__(self) -> 'Participant':
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._page is not None:
            self._page.close()
        self.loop.call_soon_threadsafe(self._task.cancel)
        self._thread.join(90.0)
        self.session.journal.close()
        assert not self._thread.is_alive()

    def wait_for(self, phase: DrivePhase, item: str) -> None:
        wait_until(lambda: self.rider.state.phase is phase and self.rider.state.item == item,
                   f'{item} to be {phase}; it is {self.rider.state}')

    def begin(self, item: str, factor: float = 1.0) -> None:
        """Claim the seat of a trial that is ready, set its pace, and confirm to be ready."""
        self.wait_for(DrivePhase.READY, item)
        graph = self.drives._graph
        assert graph is not None
        self.graphs.append(graph.pid)
        address = graph.cockpit
        if self._page is None or self._page.closed or self._page.page != address:
            if self._page is not None:
                self._page.close()
            self._page = PageClient(address)
        wait_until(lambda: self._page is not None and self._page.request(
            'claim', seat='hv0', device='')['ok'], 'the seat')
        self._page.hold_keys('hv0', [1, 0, 0, 0])
        self._page.order('rate', factor=factor)
        self.loop.call_soon_threadsafe(self.rider.ready, item)

    @property
    def page(self) -> PageClient:
        """Return the page that has the seat."""
        assert self._page is not None
        return self._page

    def stands(self) -> None:
        """Assert that a trial does not begin by itself when its seat is taken."""
        time.sleep(1.0)
        assert self.page.documents['status']['run'] == 'paused'
        assert self.page.documents['status']['n'] == 0

    def call(self, function: Any, *arguments: Any) -> None:
        self.loop.call_soon_threadsafe(function, *arguments)


@pytest.fixture(scope='module')
def journal(tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[dict[str, Any]]]:
    """Drive four trials: one is killed, one aborted, one skipped, one stopped and reset."""
    folder = tmp_path_factory.mktemp('study') / 'participants' / 'P01'
    with Participant(folder) as person:
        person.begin('main/1', SLOWEST)
        person.wait_for(DrivePhase.DRIVING, 'main/1')
        # The launcher is killed: its nodes end with it.
        os.kill(person.graphs[-1], signal.SIGKILL)
        person.begin('main/1')
        person.begin('main/2', SLOWEST)
        person.wait_for(DrivePhase.DRIVING, 'main/2')
        wait_until(lambda: (person.rider.state.time_s or 0.0) > 0.5, 'some of the run')
        person.call(person.rider.abort, 'a telephone rang')
        person.wait_for(DrivePhase.READY, 'main/2')
        person.stands()
        person.begin('main/2')
        person.begin('main/3', SLOWEST)
        person.wait_for(DrivePhase.DRIVING, 'main/3')
        person.call(person.session.skip, 'no time left')
        person.call(person.rider.wake)
        for action in ('stop', 'reset'):
            person.begin('main/4', SLOWEST)
            person.wait_for(DrivePhase.DRIVING, 'main/4')
            assert person.page.request('control', action=action)['ok']
            person.wait_for(DrivePhase.READY, 'main/4')
        person.begin('main/4')
        wait_until(lambda: person.session.next_item is None, 'the end')
        wait_until(lambda: person.rider.state.phase is DrivePhase.NONE, 'the graph to end')
        person._thread.join(90.0)
        assert not any(is_node(pid) for pid in person.graphs)
    entries = read_journal(folder)
    for entry in entries:
        entry['folder'] = folder
    yield entries


def test_each_trial_is_finished_once_or_skipped(journal: list[dict[str, Any]]) -> None:
    told = [(entry['entry'], entry['item']) for entry in journal if 'item' in entry]
    assert told == [
        ('started', 'main/1'), ('aborted', 'main/1'), ('started', 'main/1'),
        ('finished', 'main/1'),
        ('started', 'main/2'), ('aborted', 'main/2'), ('started', 'main/2'),
        ('finished', 'main/2'),
        ('started', 'main/3'), ('skipped', 'main/3'), ('aborted', 'main/3'),
        ('started', 'main/4'), ('aborted', 'main/4'), ('started', 'main/4'),
        ('aborted', 'main/4'), ('started', 'main/4'), ('finished', 'main/4')]
    reasons = [entry['reason'] for entry in journal if entry['entry'] == 'aborted']
    assert 'killed' in reasons[0]
    assert reasons[1] == 'a telephone rang'
    # No other client of the graph has made half a trial.
    assert reasons[3:] == ['the run was stopped by hand', 'the run was started again by hand']


def test_what_is_finished_was_driven_to_its_end(journal: list[dict[str, Any]]) -> None:
    finished = [entry for entry in journal if entry['entry'] == 'finished']
    assert [entry['attempt'] for entry in finished] == [2, 2, 3]
    for entry in finished:
        assert entry['outcome'] == 'time'
        assert entry['end_time_s'] == pytest.approx(DURATION_S)
        assert entry['asked_at'] < entry['start_at'] < entry['at']
        log = read_trajectories(recording_in(entry['folder'] / entry['run']))
        # Scenario steps of 0.1 s, the first included.
        assert len(log.ks) == round(DURATION_S / 0.1) + 1


def test_each_run_holds_its_own_game(journal: list[dict[str, Any]]) -> None:
    finished = {entry['item']: entry for entry in journal if entry['entry'] == 'finished'}
    games = {item: (entry['folder'] / entry['run'] / 'game.yaml').read_text()
             for item, entry in finished.items()}
    assert 'CutIn' in games['main/1']
    assert 'Merge' in games['main/2']
    assert 'Merge' in games['main/4']
    assert len({entry['run'] for entry in finished.values()}) == 3


def test_the_level_that_an_answer_decides_on_is_driven(tmp_path: Path) -> None:
    folder = tmp_path / 'participants' / 'P01'
    staircase = {'factor': 'scene', 'rule': '1-down 1-up', 'stop': {'at_most': 2},
                 'success': {'question': 'useful', 'at_least': 3}}
    with Participant(folder, staircase=staircase,
                     after_trial=[{'questions': 'van_der_laan'}]) as person:
        def answer() -> None:
            item = person.session.next_item
            assert item is not None
            person.session.finish({each.name: 5 for each in person.session.questions(item)})
            person.drives.wake()

        person.begin('main/1')
        # While the participant answers, the foreseen level is loaded: the same again.
        wait_until(lambda: person.drives._loaded is not None
                   and person.drives._loaded.item.id == 'main/2', 'the next game')
        assert person.session.next_item.id == 'main/1/after/1'
        person.call(answer)
        person.begin('main/2')
        wait_until(lambda: person.session.next_item.id == 'main/2/after/1', 'the second drive')
        person.call(answer)
        wait_until(lambda: person.session.next_item is None, 'the end')
        person._thread.join(90.0)
    entries = read_journal(folder)
    assert [entry['condition'] for entry in entries if entry['entry'] == 'started'] == [
        'cut-in', 'merge']
    for entry, game in zip((entry for entry in entries if entry.get('run') and entry[
            'entry'] == 'finished'), ('CutIn', 'Merge'), strict=True):
        assert game in (folder / entry['run'] / 'game.yaml').read_text()
