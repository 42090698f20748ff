# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Conducts a session's drives in the live graph; prepares them while participants answer."""

import asyncio
from collections.abc import Callable, Sequence
from pathlib import Path
import secrets
import time

from crgame_ros.errors import CrgameError
from crgame_ros.recording.metadata import METADATA_FILE
from crgame_ros.recording.run_folder import bags_of, run_folder
from crgame_ros.study.conduct.study_drive import (
    clean_s,
    cut_short,
    Disturbance,
    outcome_of,
    RESET,
    Rider,
    StudyDrive,
    write_drive,
)
from crgame_ros.study.conduct.study_graph import Director, make_links, StudyGraph
from crgame_ros.study.drive_watch import (
    DrivePhase,
    DriveState,
    DriveWatch,
    DriveWork,
    UNDER_WAY,
)
from crgame_ros.study.participant_session import ParticipantSession
from crgame_ros.study.session_script import is_driven, PracticeDrives, SessionItem
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
    Conducts the drives of those who drive together, in one graph as long as it runs.

    :param sessions: of the participants, in the order of their seats; joined if there are several.
    :param folder: of the first participant, which has the recordings.
    :param port: of the cockpit.
    :param more: returns further arguments of the launcher.
    :param certificate: of the cockpit, if it is opened to other machines by links.
    :ivar riders: the participants' parts, in the same order.
    """

    def __init__(self, sessions: Sequence[ParticipantSession], folder: Path, port: int,
                 more: Callable[[], Sequence[str]] = tuple,
                 certificate: Path | None = None) -> None:
        self.riders = tuple(Rider(session, self) for session in sessions)
        self._folder = folder
        self._port, self._more, self._certificate = port, more, certificate
        # Of the present graph: to watch, and for each who drives.
        self._links: tuple[str, ...] | None = None
        # By which the cockpit recognises the experimenter who drives.
        self._key = secrets.token_hex(16)
        self._phase, self._item = DrivePhase.NONE, ''
        self._graph: StudyGraph | None = None
        self._director: Director | None = None
        # The drive that the graph has loaded but not yet driven.
        self._loaded: StudyDrive | None = None
        self._news = asyncio.Event()
        self._abort: str | None = None
        self._deaths_s: list[float] = []

    @property
    def time_s(self) -> float | None:
        """Return the clock of the present run [s]; None without a graph."""
        return None if self._director is None else self._director.time_s

    def wake(self) -> None:
        """Report that a session has advanced."""
        self._news.set()
        if len(self.riders) > 1:
            # What one does may change the sessions of the others.
            for rider in self.riders:
                rider.tell()

    def abort(self, reason: str) -> None:
        """End the present drive; it is repeated."""
        if self._phase in (DrivePhase.COUNTDOWN, DrivePhase.DRIVING):
            self._abort = reason
            self._news.set()

    def record(self, kind: str, text: str) -> None:
        """Add a note or marker to the present recording, if there is one."""
        if self._director is not None and self._phase is DrivePhase.DRIVING:
            self._director.poll()
            self._director.record(kind, text)

    async def run(self) -> None:
        """Prepare and conduct drives until the session is over."""
        while any(rider.session.next_item is not None for rider in self.riders):
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
        try:
            if self._phase in UNDER_WAY:
                self._abort_all(self._item, 'the study was ended')
        finally:
            # The graph ends even if the journals take no more entries.
            self._phase, self._item, self._loaded = DrivePhase.NONE, '', None
            for rider in self.riders:
                rider.enter(DriveState())
            graph, self._graph = self._graph, None
            if self._director is not None:
                self._director.close()
                self._director = None
            if graph is not None:
                await asyncio.to_thread(graph.end)

    def _abort_all(self, item: str, reason: str) -> None:
        for rider in self.riders:
            rider.session.abort(reason, item)

    def _next(self) -> SessionItem | None:
        """Return the next item to drive, even if other items come before it."""
        sessions = [rider.session for rider in self.riders]
        if any(session.next_item is None for session in sessions):
            return None
        done = sessions[0].done
        return next((item for item in sessions[0].items
                     if item.id not in done and is_driven(item)), None)

    def _is_due(self, item: SessionItem) -> bool:
        return all(rider.is_due(item.id) for rider in self.riders)

    async def _conduct(self, item: SessionItem) -> None:
        """Prepare an item, and drive it once it is due and all participants are ready."""
        drive = await self._prepare(item)
        for rider in self.riders:
            rider.ask()
        while self._next() is item:
            self._set_phase(DrivePhase.READY, item.id, drive=drive)
            if self._is_due(item) and all(rider.is_ready for rider in self.riders):
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
        director.watch(drive.seats)
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
                self._links = await make_links(graph.director, self._certificate,
                                               len(self.riders) + 1)
            except CrgameError:
                # Without links nobody could drive in this graph: the next try begins another.
                await self.close()
                raise
        return director

    async def _drive(self, drive: StudyDrive) -> None:
        """Drive once, from the start to a closed recording."""
        item, director = drive.item, self._directs()
        assert self._graph is not None
        epoch = director.epoch
        folder = run_folder(self._graph.folder, epoch)
        run = str(folder.relative_to(self._folder))
        self._loaded, self._abort = None, None
        asked_at_s = time.time()
        attempt = max(rider.session.start(run) for rider in self.riders)
        self._set_phase(DrivePhase.COUNTDOWN, item.id, attempt=attempt, drive=drive)
        await director.start()
        began_at_s = 0.0
        disturbance = Disturbance(LOST_S)
        for rider, seat in zip(self.riders, drive.seats, strict=True):
            rider.drive_watch = DriveWatch(seat)
        director.drive_watches = tuple(rider.drive_watch for rider in self.riders)
        while director.status.run != 'ended':
            if director.status.run == 'running' and not began_at_s:
                began_at_s = time.time()
                condition = item.what.condition.name if isinstance(item.what, PlannedTrial) \
                    else 'practice'
                director.record('trial', f'{item.id}: {condition}, attempt {attempt}',
                                item=item.id, condition=condition, attempt=attempt)
                self._set_phase(DrivePhase.DRIVING, item.id, attempt=attempt, drive=drive)
            if began_at_s and self._abort is None:
                self._abort = disturbance.check(any(
                    director.status.seats_lost.get(seat, False) for seat in drive.seats))
            if self._abort is None and director.epoch != epoch:
                self._abort = cut_short(RESET)
            if self._abort is not None or not self._is_due(item):
                await self._break_off(item, self._abort)
                return
            for rider in self.riders:
                rider.tell_doubts()
            await self._poll()
        if reason := cut_short(director.status.reason):
            await self._break_off(item, reason)
            return
        self._set_phase(DrivePhase.ENDED, item.id, attempt=attempt, drive=drive)
        told = {'run': run, 'attempt': attempt, 'asked_at': asked_at_s, 'start_at': began_at_s}
        await self._until(lambda: _is_closed(folder), CLOSES_S, 'the recording is not closed')
        for rider in self.riders:
            rider.drive_watch.add_timing(director.status.timing)
        doubts = {str(doubt): doubt for rider in self.riders for doubt in rider.doubts}
        step = self.riders[0].session.study.quality.next_step(
            tuple(doubts.values()), self.riders[0].repeats(item.id, DOUBTFUL))
        if isinstance(item.what, PlannedTrial) and step == 'repeat':
            self._abort_all(item.id, f'{DOUBTFUL}{"; ".join(doubts)}')
            self._set_phase(DrivePhase.PREPARING, item.id, work=DriveWork.AGAIN)
            return
        self._finish(drive, told, hold=step == 'stop')
        self._set_phase(DrivePhase.NONE)

    def _finish(self, drive: StudyDrive, told: dict[str, object], hold: bool) -> None:
        """
        Note a complete drive in all journals.

        :param told: what is the same for all participants.
        :param hold: whether the sessions wait for the experimenter then.
        """
        status, end_s, what = self._directs().status, self._directs().time_s, drive.item.what
        clean = [clean_s(status, seat, end_s) for seat in drive.seats]
        for rider, seat, without_s in zip(self.riders, drive.seats, clean, strict=True):
            own = {**told, **outcome_of(status, seat, end_s), **rider.quality()}
            if isinstance(what, PracticeDrives):
                rider.session.practised(min(clean) >= what.practice.seconds, **own,
                                        clean_s=without_s)
            else:
                if hold:
                    rider.session.hold(True)
                rider.session.finish(None, **own)

    async def _break_off(self, item: SessionItem, reason: str | None) -> None:
        """End a run that does not count: it was aborted, or its item was skipped."""
        director = self._directs()
        self._abort_all(item.id, reason or 'the session went on with something else')
        self._set_phase(DrivePhase.PREPARING, item.id, work=DriveWork.STOPPED)
        if director.status.run != 'ended':
            await director.stop()
        await self._until(lambda: director.status.run == 'ended', CLOSES_S, 'the run does not end')

    async def _lose(self) -> None:
        """Record the loss of the graph; another one is started for the same drive."""
        graph, words = self._graph, 'it was killed'
        if graph is not None and not graph.was_killed:
            words = graph.last_words()
        item = self._item
        if self._phase in UNDER_WAY:
            self._abort_all(item, f'the simulation ended by itself: {words}')
        self._set_phase(DrivePhase.PREPARING, item, words, work=DriveWork.RESTARTING)
        await self.close()
        self._set_phase(DrivePhase.PREPARING, item, words, work=DriveWork.RESTARTING)
        now_s = time.monotonic()
        self._deaths_s = [at for at in self._deaths_s if now_s - at < DEATHS_S] + [now_s]
        if len(self._deaths_s) >= MAX_DEATHS:
            self._deaths_s.clear()
            await self._await_order(item, words, DriveWork.NO_START)

    async def _fail(self, item: SessionItem, text: str) -> None:
        """Show the experimenter why an item cannot be driven, and wait for them."""
        if self._graph is not None and self._graph.has_ended:
            await self._lose()
            return
        if self._phase in UNDER_WAY:
            self._abort_all(item.id, text)
        self._loaded = None
        try:
            await self._await_order(item.id, text)
        except _LostGraphError:
            await self._lose()

    async def _await_order(self, item: str, text: str, work: DriveWork = DriveWork.NONE) -> None:
        """Show why an item is not driven until somebody has done something about it."""
        self._news.clear()
        self._set_phase(DrivePhase.FAILED, item, text, work=work)
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
        """Poll the graph until something changes, or has changed since the last time."""
        while not self._news.is_set():
            await self._poll()
        self._news.clear()

    def _set_phase(self, phase: DrivePhase, item: str = '', text: str = '', *,
                   work: DriveWork = DriveWork.NONE, attempt: int = 0,
                   drive: StudyDrive | None = None) -> None:
        self._phase, self._item = phase, item
        links = self._links_to(drive)
        for rider, (link, watch, confederate) in zip(self.riders, links, strict=True):
            # The page may load its frame while the participant still answers.
            mine = DrivePhase.NONE if phase is DrivePhase.READY and not rider.is_due(item) \
                else phase
            rider.enter(DriveState(
                mine, item, attempt, link, watch, None, work, text, confederate=confederate,
                awaits_others=mine is DrivePhase.READY and rider.is_ready))

    def _links_to(self, drive: StudyDrive | None) -> list[tuple[str, str, str]]:
        """Return each participant's links: to drive, to watch, and for the experimenter's seat."""
        if drive is None or self._graph is None:
            return [('', '', '') for _ in self.riders]
        watched, experimenters, *pages = self._links or (
            self._graph.cockpit,) * (2 + len(self.riders))
        other, study = drive.settings.confederate, self.riders[0].session.study
        confederate = '' if other is None else drive.link(
            experimenters, other, study.language, self._key)
        return [(drive.link(page, seat, rider.session.page_language, rider.key),
                 drive.watch_link(watched, seat), confederate)
                for page, seat, rider in zip(pages, drive.seats, self.riders, strict=True)]


def _is_closed(folder: Path) -> bool:
    bags = bags_of(folder)
    return bool(bags) and (bags[-1] / METADATA_FILE).is_file()
