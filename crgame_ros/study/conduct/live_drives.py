# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Conducts a session's drives in the live graph; prepares them while participants answer."""

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
import secrets
import time

from crgame_ros.errors import CrgameError
from crgame_ros.recording.metadata import METADATA_FILE
from crgame_ros.recording.run_folder import bags_of, run_folder
from crgame_ros.study.conduct.cockpit_links import make_links
from crgame_ros.study.conduct.director import Director
from crgame_ros.study.conduct.study_drive import (
    clean_s,
    cut_short,
    Disturbance,
    outcome_of,
    RESET,
    settings_of,
    StudyDrive,
    write_drive,
)
from crgame_ros.study.conduct.study_graph import StudyGraph
from crgame_ros.study.drive_state import DrivePhase, DriveState, DriveWork
from crgame_ros.study.drive_watch import DriveWatch
from crgame_ros.study.participant_session import ParticipantSession
from crgame_ros.study.quality import Excess, PAGE, TIMING
from crgame_ros.study.session_journal import SessionEvent
from crgame_ros.study.session_script import PracticeDrives, SessionItem
from crgame_ros.study.trial_plan import PlannedTrial

LOOK_S = 0.02
# Time limit for closing a recording and for loading a game [s].
CLOSES_S = 20.0
LOADS_S = 60.0
# A trial does not count if the participant's page was gone for this long [s].
LOST_S = 2.0
# Begins the reason why a drive came again that was complete.
DOUBTFUL = 'its data do not hold: '
# A graph that dies this often within this time is not restarted [s].
MAX_DEATHS, DEATHS_S = 3, 120.0


class _LostGraphError(Exception):
    """An unexpected end of the graph."""


class LiveDrives:
    """
    Conducts a participant's drives, in one graph as long as it runs.

    :param session: the session.
    :param folder: of the participant.
    :param language: returns that of the participant.
    :param port: of the cockpit.
    :param more: returns further arguments of the launcher.
    :param certificate: of the cockpit, if it is opened to other machines by links.
    """

    def __init__(self, session: ParticipantSession, folder: Path, language: Callable[[], str],
                 port: int, more: Callable[[], Sequence[str]] = tuple,
                 certificate: Path | None = None) -> None:
        self._session, self._folder, self._language = session, folder, language
        self._port, self._more, self._certificate = port, more, certificate
        # To drive and to watch, of the present graph.
        self._links: tuple[str, str] | None = None
        self._key = secrets.token_hex(16)
        self._graph: StudyGraph | None = None
        self._director: Director | None = None
        # The drive that the graph has loaded but not yet driven.
        self._loaded: StudyDrive | None = None
        self._state = DriveState()
        self._changed: list[Callable[[], None]] = []
        self._news = asyncio.Event()
        self._ready = ''
        self._abort: str | None = None
        self._deaths_s: list[float] = []

    @property
    def state(self) -> DriveState:
        """Return the state of the present or next drive."""
        if self._director is None or self._state.phase not in (
                DrivePhase.DRIVING, DrivePhase.ENDED):
            return self._state
        return replace(self._state, time_s=self._director.time_s)

    def watch(self, changed: Callable[[], None]) -> None:
        """Set the callback for changes of the state or the session."""
        self._changed.append(changed)

    def wake(self) -> None:
        """Report that the session has advanced."""
        self._news.set()

    def ready(self, item: str) -> None:
        """Report that the participant is ready for a drive."""
        if self._state.phase is DrivePhase.READY and self._state.item == item:
            self._ready = item
            self._news.set()

    def abort(self, reason: str) -> None:
        """End the present drive; it is repeated."""
        if self._state.phase in (DrivePhase.COUNTDOWN, DrivePhase.DRIVING):
            self._abort = reason
            self._news.set()

    def record(self, kind: str, text: str) -> None:
        """Add a note or marker to the present recording, if there is one."""
        if self._director is not None and self._state.phase is DrivePhase.DRIVING:
            self._director.poll()
            self._director.record(kind, text)

    async def run(self) -> None:
        """Prepare and conduct drives until the session is over."""
        while self._session.next_item is not None:
            item = self._next()
            if item is None:
                # Recordings are finished while the participant answers the last questions.
                self._set_phase(DrivePhase.NONE)
                await self.close()
                await self._wait()
                continue
            try:
                await self._conduct(item)
            except _LostGraphError:
                await self._lose()
            except CrgameError as error:
                await self._fail(item, str(error))
        self._set_phase(DrivePhase.NONE)
        await self.close()

    async def close(self) -> None:
        """End the graph; a present drive does not count."""
        if self._is_under_way:
            self._session.abort('the study was ended', self._state.item)
        self._state, self._loaded = DriveState(), None
        graph, self._graph = self._graph, None
        if self._director is not None:
            self._director.close()
            self._director = None
        if graph is not None:
            await asyncio.to_thread(graph.end)

    @property
    def _is_under_way(self) -> bool:
        return self._state.phase in (DrivePhase.COUNTDOWN, DrivePhase.DRIVING, DrivePhase.ENDED)

    def _next(self) -> SessionItem | None:
        """Return the next item to drive, even if other items come before it."""
        if self._session.next_item is None:
            return None
        done = self._session.done
        return next((item for item in self._session.items
                     if item.id not in done and settings_of(item) is not None), None)

    def _is_due(self, item: SessionItem) -> bool:
        now = self._session.next_item
        return now is not None and now.id == item.id

    async def _conduct(self, item: SessionItem) -> None:
        """Prepare an item, and drive it once it is due and the participant is ready."""
        drive = await self._prepare(item)
        self._ready = ''
        while self._next() is item:
            due = self._is_due(item)
            # The page may load its frame while the participant still answers.
            self._set_phase(DrivePhase.READY if due else DrivePhase.NONE, item.id, drive=drive)
            if due and self._ready == item.id:
                await self._drive(drive)
                return
            await self._wait()

    async def _prepare(self, item: SessionItem) -> StudyDrive:
        # A foreseen trial of a staircase may have another level by now.
        if self._loaded is not None and self._loaded.item == item:
            return self._loaded
        if self._is_due(item):
            self._set_phase(DrivePhase.PREPARING, item.id, work=DriveWork.LOADING)
        drive = write_drive(item, self._folder / 'games')
        assert drive is not None
        if self._graph is None:
            director = await self._start_graph(drive)
        else:
            director = self._directs()
            epoch = director.epoch
            await director.load(drive.game)
            await self._until(lambda: director.epoch > epoch, LOADS_S, 'the game does not begin')
        director.watch(drive.seat)
        await self._until(lambda: director.status.run == 'paused', LOADS_S,
                          'the simulation does not get ready')
        self._loaded = drive
        return drive

    async def _start_graph(self, drive: StudyDrive) -> Director:
        runs = self._folder / 'runs'
        number = 1 + max((int(path.name) for path in runs.glob('*') if path.name.isdecimal()),
                         default=0)
        graph = self._graph = StudyGraph(drive.game, runs / str(number), self._port, self._more())
        director = self._director = Director(graph.domain_id)
        opened = self._certificate is not None
        await self._until(lambda: bool(graph.director if opened else graph.cockpit)
                          and director.game is not None, LOADS_S, 'the simulation does not start')
        if self._certificate is not None:
            try:
                self._links = await make_links(graph.director, self._certificate)
            except CrgameError:
                # Without links nobody could drive in this graph: the next try begins another.
                await self.close()
                raise
        return director

    async def _drive(self, drive: StudyDrive) -> None:
        """Drive once, from the start to a closed recording."""
        item, director, session = drive.item, self._directs(), self._session
        assert self._graph is not None
        epoch = director.epoch
        folder = run_folder(self._graph.folder, epoch)
        run = str(folder.relative_to(self._folder))
        self._loaded, self._abort = None, None
        asked_at_s = time.time()
        attempt = session.start(run)
        self._set_phase(DrivePhase.COUNTDOWN, item.id, attempt=attempt, drive=drive)
        await director.start()
        began_at_s = 0.0
        disturbance = Disturbance(LOST_S)
        watch = director.drive_watch = DriveWatch(drive.seat)
        while director.status.run != 'ended':
            if director.status.run == 'running' and not began_at_s:
                began_at_s = time.time()
                condition = item.what.condition.name if isinstance(item.what, PlannedTrial) \
                    else 'practice'
                director.record('trial', f'{item.id}: {condition}, attempt {attempt}',
                                item=item.id, condition=condition, attempt=attempt)
                self._set_phase(DrivePhase.DRIVING, item.id, attempt=attempt, drive=drive)
            if began_at_s and self._abort is None:
                self._abort = disturbance.check(director.status.seats_lost.get(drive.seat, False))
            if self._abort is None and director.epoch != epoch:
                self._abort = cut_short(RESET)
            if self._abort is not None or not self._is_due(item):
                await self._break_off(item, self._abort)
                return
            self._tell_doubts(watch)
            await self._poll()
        if reason := cut_short(director.status.reason):
            await self._break_off(item, reason)
            return
        self._set_phase(DrivePhase.ENDED, item.id, attempt=attempt, drive=drive)
        told = {'run': run, 'attempt': attempt, 'asked_at': asked_at_s, 'start_at': began_at_s,
                **outcome_of(director.status, drive.seat, director.time_s)}
        await self._until(lambda: _is_closed(folder), CLOSES_S, 'the recording is not closed')
        watch.add_timing(director.status.timing)
        doubts = self._doubts(watch)
        told |= {'quality': watch.values(), 'doubts': list(map(str, doubts))}
        step = session.study.quality.next_step(doubts, self._repeats(item))
        if isinstance(item.what, PlannedTrial) and step == 'repeat':
            session.abort(f'{DOUBTFUL}{"; ".join(map(str, doubts))}', item.id)
            self._set_phase(DrivePhase.PREPARING, item.id, work=DriveWork.AGAIN)
            return
        if isinstance(item.what, PracticeDrives):
            wanted_s = item.what.practice.seconds
            told['clean_s'] = clean_s(director.status, drive.seat, director.time_s)
            session.practised(told['clean_s'] >= wanted_s, **told)
        else:
            if step == 'stop':
                session.hold(True)
            session.finish(**told)
        self._set_phase(DrivePhase.NONE)

    def _doubts(self, watch: DriveWatch) -> tuple[Excess, ...]:
        return tuple(self._session.study.quality.excesses(watch.values(), {**TIMING, **PAGE}))

    def _tell_doubts(self, watch: DriveWatch) -> None:
        """Tell what is beyond a bound as soon as it is."""
        doubts = self._doubts(watch)
        if doubts != self._state.doubts and self._state.phase is DrivePhase.DRIVING:
            self._state = replace(self._state, doubts=doubts)
            self._tell()

    def _repeats(self, item: SessionItem) -> int:
        """Return how often a drive came again because of its data."""
        return sum(entry['entry'] == SessionEvent.ABORTED and entry['item'] == item.id
                   and str(entry.get('reason')).startswith(DOUBTFUL)
                   for entry in self._session.journal.entries)

    async def _break_off(self, item: SessionItem, reason: str | None) -> None:
        """End a run that does not count: it was aborted, or its item was skipped."""
        director = self._directs()
        self._session.abort(reason or 'the session went on with something else', item.id)
        self._set_phase(DrivePhase.PREPARING, item.id, work=DriveWork.STOPPED)
        if director.status.run != 'ended':
            await director.stop()
        await self._until(lambda: director.status.run == 'ended', CLOSES_S,
                          'the run does not end')

    async def _lose(self) -> None:
        """Record the loss of the graph; another one is started for the same drive."""
        graph, words = self._graph, 'it was killed'
        if graph is not None and not graph.was_killed:
            words = graph.last_words()
        item = self._state.item
        if self._is_under_way:
            self._session.abort(f'the simulation ended by itself: {words}', item)
        self._set_phase(DrivePhase.PREPARING, item, words, work=DriveWork.RESTARTING)
        await self.close()
        self._set_phase(DrivePhase.PREPARING, item, words, work=DriveWork.RESTARTING)
        now_s = time.monotonic()
        self._deaths_s = [at for at in self._deaths_s if now_s - at < DEATHS_S] + [now_s]
        if len(self._deaths_s) >= MAX_DEATHS:
            self._deaths_s.clear()
            self._set_phase(DrivePhase.FAILED, item, words, work=DriveWork.NO_START)
            await self._wait()

    async def _fail(self, item: SessionItem, text: str) -> None:
        """Show the experimenter why an item cannot be driven, and wait for them."""
        if self._graph is not None and self._graph.has_ended:
            await self._lose()
            return
        if self._is_under_way:
            self._session.abort(text, item.id)
        self._loaded = None
        self._set_phase(DrivePhase.FAILED, item.id, text)
        await self._wait()

    def _directs(self) -> Director:
        if self._director is None:
            raise _LostGraphError
        return self._director

    async def _poll(self, pause_s: float = LOOK_S) -> None:
        """Poll the graph, then pause."""
        graph, director = self._graph, self._director
        if graph is not None and director is not None:
            graph.poll()
            director.poll()
            # Last: the nodes of a killed launcher say that they were asked to end.
            if graph.has_ended:
                raise _LostGraphError
        await asyncio.sleep(pause_s)

    async def _until(self, condition: Callable[[], bool], patience_s: float, what: str) -> None:
        until_s = time.monotonic() + patience_s
        while not condition():
            if time.monotonic() > until_s:
                raise CrgameError(f'{what} in {patience_s:g} s')
            await self._poll()

    async def _wait(self) -> None:
        """Poll the graph until something changes."""
        self._news.clear()
        while not self._news.is_set():
            await self._poll()

    def _set_phase(self, phase: DrivePhase, item: str = '', text: str = '', *,
                   work: DriveWork = DriveWork.NONE, attempt: int = 0,
                   drive: StudyDrive | None = None) -> None:
        link = watch = ''
        if drive is not None and self._graph is not None:
            page, watched = self._links or (self._graph.cockpit, self._graph.cockpit)
            link = drive.link(page, self._language(), self._key)
            watch = drive.watch_link(watched)
        state = DriveState(phase, item, attempt, link, watch, None, work, text)
        if state != self._state:
            self._state = state
            self._tell()

    def _tell(self) -> None:
        for changed in self._changed:
            changed()


def _is_closed(folder: Path) -> bool:
    bags = bags_of(folder)
    return bool(bags) and (bags[-1] / METADATA_FILE).is_file()
