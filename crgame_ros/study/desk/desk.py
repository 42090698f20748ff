# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The desk of a session: the actions of participant and experimenter, and their watchers."""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
import logging
import statistics
import time
from typing import Protocol

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.study.drive_watch import DrivePhase, DriveState, UNDER_WAY
from crgame_ros.study.file import Break, Page
from crgame_ros.study.participant_session import ParticipantSession
from crgame_ros.study.questionnaire import consent_of
from crgame_ros.study.session_journal import DECLINED, first_of, SessionEvent
from crgame_ros.study.session_script import is_driven


class Drives(Protocol):
    """
    Conducts the drives of a session: trials and practice.

    It starts, finishes and aborts these items in the session; the desk handles all others.
    """

    @property
    def state(self) -> DriveState:
        """Return the state of the present or next drive."""

    def watch(self, changed: Callable[[], None]) -> None:
        """Set the callback, run on the event loop, for changes of the state or the session."""

    def wake(self) -> None:
        """Report that the session has advanced: another item may have to be driven."""

    def ready(self, item: str) -> None:
        """Report that the participant is ready for the drive of an item."""

    def record(self, kind: str, text: str) -> None:
        """Add a note or marker to the present recording, if there is one."""

    def abort(self, reason: str) -> None:
        """End the present drive; it does not count and is repeated."""


# Pings of the last seconds, of which half are needed to judge the link.
PINGS = 10

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class LinkDelay:
    """
    Round trips between the participant's page and this machine, of the last seconds.

    :param median_ms: of them [ms]
    :param worst_ms: the longest [ms]
    :param bound_ms: what the median may be at most [ms]
    """

    median_ms: int
    worst_ms: int
    bound_ms: int


class Desk:
    """
    Handles the requests of both pages, and calls the watcher after each change.

    :param drives: conducts the drives.
    :param clock_s: seconds since 1970.
    """

    def __init__(self, session: ParticipantSession, drives: Drives, *,
                 clock_s: Callable[[], float] = time.time) -> None:
        self.session, self.drives, self.clock_s = session, drives, clock_s
        # The reason for ending the session after its present drive; empty otherwise.
        self.ending = ''
        # When a page of the participant was heard last; at first now [s since 1970].
        self.heard_s = clock_s()
        self._watchers: list[Callable[[], None]] = []
        self._round_trips_ms: deque[float] = deque(maxlen=PINGS)
        self._told_slow = False
        drives.watch(self._drive_changed)
        self._begin_break()

    def watch(self, changed: Callable[[], None]) -> None:
        """Set the callback for every change."""
        self._watchers.append(changed)

    @property
    def language(self) -> str:
        """Return the language of the participant's page."""
        return self.session.page_language

    @property
    def asks_language(self) -> bool:
        """Return whether the participant has to choose a language first."""
        return self.session.language is None and len(self.session.study.all_languages) > 1

    @property
    def is_driving(self) -> bool:
        """Return whether a drive is under way, from its countdown until it is recorded."""
        return self.drives.state.phase in UNDER_WAY

    @property
    def can_abort(self) -> bool:
        """Return whether a drive is under way that has not ended by itself."""
        return self.is_driving and self.drives.state.phase != DrivePhase.ENDED

    @property
    def waits(self) -> bool:
        """Return whether the experimenter holds the session before its present item."""
        held_at, item = self.session.held_at, self.session.next_item
        if held_at is None or item is None or self.is_driving:
            return False
        return is_driven(item) or item.id != held_at

    @property
    def break_left_s(self) -> float:
        """Return the minimum time left of the present break [s]; 0 without a break."""
        item = self.session.next_item
        if item is None or not isinstance(item.what, Break):
            return 0.0
        began = first_of(reversed(self.session.journal.entries), SessionEvent.STARTED,
                         item=item.id)
        at = self.clock_s() if began is None else began['at']
        return max(0.0, at + 60.0 * item.what.minutes - self.clock_s())

    @property
    def slow_link(self) -> LinkDelay | None:
        """Return the delay that keeps the first drive from beginning; None if nothing does."""
        bound_s, told_ms = self.session.study.quality.link_delay_s, self._round_trips_ms
        if bound_s is None or len(told_ms) < PINGS // 2 \
                or statistics.median(told_ms) <= 1e3 * bound_s \
                or any(entry.get('run') for entry in self.session.journal.entries):
            return None
        return LinkDelay(*(round(value) for value in (
            statistics.median(told_ms), max(told_ms), 1e3 * bound_s)))

    def hear_round_trip(self, delay_ms: float) -> None:
        """Take the round trip of a ping of the participant's page [ms]."""
        before = self.slow_link
        self._round_trips_ms.append(delay_ms)
        slow, item = self.slow_link, self.session.next_item
        if item is None or not is_driven(item) or slow == before:
            return
        if slow is not None and not self._told_slow:
            self._told_slow = True
            self.session.note(f'the link is too slow for the first drive: {slow.median_ms} ms, at '
                              f'worst {slow.worst_ms} ms', **self.moment())
        self._notify()

    # Actions of the participant.

    def choose_language(self, language: str) -> None:
        """Set the participant's language."""
        self.session.choose_language(language)
        self._moved()

    def finish(self, item: str, answers: Mapping[str, object] | None = None,
               agreed: bool | None = None, **told: object) -> None:
        """
        Finish an item that is not driven, with the participant's answers.

        Nothing happens if it is not the present item, or if the experimenter holds the session, so
        a second click or another page has no effect.

        :param item: id of the item.
        :param answers: to its questions.
        :param agreed: to a consent; False ends the session.
        :param told: when it was shown and answered, and how long it took.
        :raises InputError: if an answer is refused, or a break is not over yet.
        """
        now = self.session.next_item
        if now is None or now.id != item or self.waits or self.ending or is_driven(now):
            return
        if self.break_left_s > 0.5:
            raise InputError('is not over', 'the break', 'wait until it is')
        if isinstance(now.what, Page) and now.what.consent:
            told['consent'] = consent_of(self.session.study, now.what, self.language)
            if agreed is False:
                self.session.end(DECLINED, consent=told['consent'])
                self._moved()
                return
            told['agreed'] = agreed
        self.session.finish(answers, **told)
        self._moved()

    def ready(self, item: str) -> None:
        """Report that the participant is ready for a drive."""
        state = self.drives.state
        if state.phase == DrivePhase.READY and state.item == item and not self.waits \
                and not self.ending and self.slow_link is None:
            self.drives.ready(item)

    # Actions of the experimenter.

    def note(self, text: str) -> None:
        """Record a note, with the run and its clock."""
        self.session.note(text, **self.moment())
        self.drives.record('note', text)
        self._notify()

    def mark(self, name: str) -> None:
        """Record a marker, with the run and its clock."""
        self.session.mark(name, **self.moment())
        self.drives.record('marker', name)
        self._notify()

    def repeat(self, item: str, reason: str) -> None:
        """Repeat a finished item now."""
        self._refuse_while_driving()
        self.session.repeat(item, reason)
        self._moved()

    def skip(self, item: str, reason: str) -> None:
        """Skip the present item."""
        self._refuse_while_driving()
        now = self.session.next_item
        if now is None or now.id != item:
            raise InputError('is not the present item', item[:60],
                             'see the list for the present one')
        self.session.skip(reason)
        self._moved()

    def abort(self, item: str, reason: str) -> None:
        """End the present drive; it is repeated."""
        if not self.is_driving or self.drives.state.item != item:
            raise InputError('is not being driven', item[:60], 'see the list for the present one')
        if not self.can_abort:
            raise InputError('has ended already', item[:60], 'repeat it once it is recorded')
        self.drives.abort(reason)
        self._notify()

    def end(self, reason: str) -> None:
        """End the session; a present drive is aborted first."""
        if self.session.next_item is None:
            raise InputError('has already ended', 'the session', '')
        self.ending = reason
        if self.is_driving:
            self.drives.abort(reason)
        self._drive_changed()

    def hold(self, held: bool) -> None:
        """Hold the session before the next item, or release it."""
        self.session.hold(held)
        self._moved()

    def moment(self) -> dict[str, object]:
        """Return the run and its clock [s]; None between drives."""
        state = self.drives.state
        started = None if state.time_s is None else first_of(
            reversed(self.session.journal.entries), SessionEvent.STARTED, item=state.item)
        return {'run': '' if started is None else started.get('run', ''),
                'time_s': state.time_s}

    def _refuse_while_driving(self) -> None:
        if self.is_driving:
            raise InputError('is under way', 'a drive', 'wait for its end, or abort it first')

    def _drive_changed(self) -> None:
        """Do what had to wait for the end of a drive, and call the watcher."""
        if self.ending and not self.is_driving and self.session.next_item is not None:
            self.session.end(self.ending)
            self.drives.wake()
        self._begin_break()
        self._notify()

    def _moved(self) -> None:
        self._begin_break()
        self.drives.wake()
        self._notify()

    def _begin_break(self) -> None:
        """Start the clock of a break once, when it may begin."""
        item = self.session.next_item
        if item is None or not isinstance(item.what, Break) or self.waits:
            return
        last = next((entry['entry'] for entry in reversed(self.session.journal.entries)
                     if entry.get('item') == item.id and entry['entry'] != SessionEvent.HELD),
                    None)
        if last != SessionEvent.STARTED:
            self.session.start()

    def _notify(self) -> None:
        for changed in self._watchers:
            try:
                changed()
            except CrgameError:
                _log.exception('an observer of the desk')
