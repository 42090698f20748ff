# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A drive of a study: its game, its outcome, its disturbances, and the participant's part."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
import json
from pathlib import Path
import secrets
import time
from typing import Protocol
from urllib.parse import urlencode

from crgame_ros.cockpit.run_status import RunStatus
from crgame_ros.driver.source import COCKPIT
from crgame_ros.paths import make_folder
from crgame_ros.study.drive_watch import DrivePhase, DriveState, DriveWatch
from crgame_ros.study.participant_session import ParticipantSession
from crgame_ros.study.quality import Excess
from crgame_ros.study.session_journal import SessionEvent
from crgame_ros.study.session_script import SessionItem, settings_of
from crgame_ros.study.trial_game import seats_of, trial_game
from crgame_ros.study.trial_settings import TrialSettings
from crgame_ros.whole_file import write_text

# Reasons of complete runs: end of the duration, or a vehicle's violation of the drivability.
TIME, DRIVABILITY = 'duration', 'drivability of '
RESET = 'reset'
_CUT_SHORT = {'stop': 'the run was stopped by hand', RESET: 'the run was started again by hand',
              'signal': 'the programs were asked to end', 'silence': 'the simulation fell silent'}
# Shorter pauses of the machine count as load, not as sleep [s].
SLEEP_S = 0.5


def cut_short(reason: str) -> str:
    """
    Return why a run is not a complete drive; empty if it is one.

    :param reason: of its end, from sim_node.
    """
    if reason == TIME or reason.startswith(DRIVABILITY):
        return ''
    return _CUT_SHORT.get(reason, f'the run ended: {reason or "the reason is unknown"}')


def outcome_of(status: RunStatus, seat: str, end_time_s: float) -> dict[str, object]:
    """
    Return the outcome of a drive.

    :param status: at its end; the drive is complete.
    :param seat: vehicle of the participant.
    :param end_time_s: the run's clock then [s].
    :return: `outcome`, one of `OUTCOMES`; `end_time_s`; and the numbers of contacts and road
        departures of the vehicle.
    """
    contacts, departures = _times(status, seat)
    if status.reason == TIME:
        outcome = 'time'
    elif status.reason != f'{DRIVABILITY}{seat}' and not contacts and not departures:
        outcome = 'other'
    else:
        # The later of contact and departure ended it.
        outcome = 'collision' if contacts and contacts[-1] >= max(departures, default=0.0) \
            else 'off_road'
    return {'outcome': outcome, 'end_time_s': round(end_time_s, 6), 'contacts': len(contacts),
            'departures': len(departures)}


def clean_s(status: RunStatus, seat: str, end_time_s: float) -> float:
    """Return the longest time of a drive without a contact or road departure [s]."""
    contacts, departures = _times(status, seat)
    times = [0.0, *sorted((*contacts, *departures)), end_time_s]
    return max(later - sooner for sooner, later in pairwise(times))


def _times(status: RunStatus, seat: str) -> tuple[list[float], list[float]]:
    return ([entry['t'] for entry in status.contacts if seat in (entry['vehicle'], entry['with'])],
            [entry['t'] for entry in status.departures if entry['vehicle'] == seat])


def _boot_s() -> float:
    # This clock runs while the machine sleeps; the steady clock does not.
    return time.clock_gettime(time.CLOCK_BOOTTIME)


class Disturbance:
    """
    Detects disturbances of one drive.

    :param patience_s: how long the participant's page may be gone [s].
    :param steady_s: clock that stops while the machine sleeps [s].
    :param boot_s: clock that does not stop [s].
    """

    def __init__(self, patience_s: float, steady_s: Callable[[], float] = time.monotonic,
                 boot_s: Callable[[], float] = _boot_s) -> None:
        self._patience_s, self._steady_s, self._boot_s = patience_s, steady_s, boot_s
        self._ahead_s = boot_s() - steady_s()
        self._lost_s: float | None = None

    def check(self, lost: bool) -> str | None:
        """
        Return why the drive does not count, None if it does.

        :param lost: whether the participant's seat is empty now.
        """
        now_s = self._steady_s()
        slept_s = self._boot_s() - now_s - self._ahead_s
        if slept_s > SLEEP_S:
            return f'the machine slept for {slept_s:.0f} s'
        if not lost:
            self._lost_s = None
        elif self._lost_s is None:
            self._lost_s = now_s
        elif now_s - self._lost_s > self._patience_s:
            return f"the participant's page was gone for {self._patience_s:g} s"
        return None


@dataclass(frozen=True)
class StudyDrive:
    """
    An item of a session that is driven.

    :param item: of the session.
    :param settings: of the item.
    :param seats: the vehicles that the participants drive, in their order.
    :param game: file of its game.
    """

    item: SessionItem
    settings: TrialSettings
    seats: tuple[str, ...]
    game: Path

    def link(self, cockpit: str, seat: str, language: str, key: str) -> str:
        """
        Return the address of a cockpit page to drive.

        :param seat: of its driver.
        :param key: by which the cockpit recognises the driver in any browser.
        """
        settings = self.settings
        shown = {name: int(bool(getattr(settings, name)))
                 for name in ('map', 'names', 'plans', 'sound')}
        labels = {name: settings.label_of(name, language) for name in settings.labels or {}}
        told = {'labels': json.dumps(labels, ensure_ascii=False)} if labels else {}
        return _with_query(cockpit, {
            'stage': seat, 'view': settings.view or 'driver', **shown,
            **({} if settings.photodiode is None else {'corner': settings.photodiode}),
            'lang': language, **told, 'key': key})

    @staticmethod
    def watch_link(cockpit: str, seat: str) -> str:
        """Return the address of a page that only shows a vehicle in the drive."""
        return _with_query(cockpit, {'view': 'chase', 'vehicle': seat})


def _with_query(address: str, values: Mapping[str, object]) -> str:
    """Return a page's address with further values; it may have a token already."""
    page, _, query = address.partition('?')
    return f'{page.rstrip("/")}/?{query}{"&" if query else ""}{urlencode(values)}'


def write_drive(item: SessionItem, games: Path) -> StudyDrive | None:
    """
    Write the game of an item.

    :param games: folder of the participant's games.
    :return: None if the item is not driven.
    :raises InputError: if its game cannot be used or written.
    """
    settings = settings_of(item)
    if settings is None:
        return None
    game = trial_game(settings, COCKPIT)
    path = games / f'{item.id.replace("/", "_")}.yaml'
    make_folder(games, 'choose a folder that can be written')
    write_text(game.dump(), path)
    return StudyDrive(item, settings, seats_of(settings, game), path)


class Conductor(Protocol):
    """Conducts the drives of all who drive together."""

    @property
    def time_s(self) -> float | None:
        """Return the clock of the present run [s]; None without one."""

    def wake(self) -> None:
        """Report that a session has advanced."""

    def abort(self, reason: str) -> None:
        """End the present drive; it is repeated."""

    def record(self, kind: str, text: str) -> None:
        """Add a note or marker to the present recording, if there is one."""


class Rider:
    """
    A participant in the drives, alone or with others.

    :ivar key: by which the cockpit recognises the participant in any browser.
    :ivar drive_watch: collects what tells whether the data of the present drive hold.
    """

    def __init__(self, session: ParticipantSession, conductor: Conductor) -> None:
        self.session, self._conductor = session, conductor
        self.key = secrets.token_hex(16)
        self._is_ready = False
        self.drive_watch = DriveWatch('')
        self._state = DriveState()
        self._changed: list[Callable[[], None]] = []

    @property
    def state(self) -> DriveState:
        """Return the state of the present or next drive."""
        if self._state.phase not in (DrivePhase.DRIVING, DrivePhase.ENDED):
            return self._state
        return replace(self._state, time_s=self._conductor.time_s)

    def enter(self, state: DriveState) -> None:
        """Go to another state, and tell it."""
        if state != self._state:
            self._state = state
            self.tell()

    def watch(self, changed: Callable[[], None]) -> None:
        """Set the callback for changes of the state or the session."""
        self._changed.append(changed)

    def tell(self) -> None:
        """Call the callbacks."""
        for changed in self._changed:
            changed()

    def wake(self) -> None:
        """Report that the session has advanced."""
        self._conductor.wake()

    @property
    def is_ready(self) -> bool:
        """Return whether the participant is ready for the present drive, and nobody holds it."""
        return self._is_ready and self.session.held_at is None

    def ask(self) -> None:
        """Forget that the participant is ready: another drive comes."""
        self._is_ready = False

    def ready(self, item: str) -> None:
        """Report that the participant is ready for a drive."""
        if self._state.phase is DrivePhase.READY and self._state.item == item:
            self._is_ready = True
            self._conductor.wake()

    def abort(self, reason: str) -> None:
        """End the present drive; it is repeated."""
        self._conductor.abort(reason)

    def record(self, kind: str, text: str) -> None:
        """Add a note or marker to the present recording, if there is one."""
        self._conductor.record(kind, text)

    @property
    def doubts(self) -> tuple[Excess, ...]:
        """Return what of the present drive's data is beyond a bound of the study so far."""
        return tuple(self.session.study.quality.excesses(self.drive_watch.values()))

    def tell_doubts(self) -> None:
        """Tell what is beyond a bound as soon as it is."""
        if self._state.phase is DrivePhase.DRIVING:
            self.enter(replace(self._state, doubts=self.doubts))

    def is_due(self, item: str) -> bool:
        """Return whether an item is the participant's next one."""
        now = self.session.next_item
        return now is not None and now.id == item

    def repeats(self, item: str, why: str) -> int:
        """Return how often a drive came again for reasons that begin with `why`."""
        return sum(entry['entry'] == SessionEvent.ABORTED and entry['item'] == item
                   and str(entry.get('reason')).startswith(why)
                   for entry in self.session.journal.entries)

    def quality(self) -> dict[str, object]:
        """Return what the journal keeps about the data of the present drive."""
        return {'quality': self.drive_watch.values(), 'doubts': list(map(str, self.doubts))}
