# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A participant's part in the drives, as the desk of their session sees it."""

from collections.abc import Callable
from dataclasses import replace
import secrets
from typing import Any, Protocol

from crgame_ros.study.drive_watch import DrivePhase, DriveState, DriveWatch
from crgame_ros.study.participant_session import ParticipantSession
from crgame_ros.study.quality import Excess, PAGE, TIMING
from crgame_ros.study.session_journal import SessionEvent


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

    :param session: of the participant.
    :param conductor: of the drives.
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
        return tuple(self.session.study.quality.excesses(
            self.drive_watch.values(), {**TIMING, **PAGE}))

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

    def quality(self) -> dict[str, Any]:
        """Return what the journal keeps about the data of the present drive."""
        return {'quality': self.drive_watch.values(), 'doubts': list(map(str, self.doubts))}
