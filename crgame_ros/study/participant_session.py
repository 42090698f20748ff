# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A participant's session: finished items, the next item, and resuming after any end."""

from collections.abc import Callable, Mapping
from pathlib import Path
import time
from types import TracebackType
from typing import Self

from crgame_ros.errors import InputError
from crgame_ros.study.file import Page, StudyFile
from crgame_ros.study.pages import questions_of
from crgame_ros.study.question import check_answers, Question
from crgame_ros.study.session_journal import SessionEvent, SessionJournal
from crgame_ros.study.session_script import PracticeDrives, session_of, SessionItem
from crgame_ros.study.trial_plan import PlannedTrial


class ParticipantSession:
    """
    The progress of a session; every step is in the journal before it counts.

    :param study: its study.
    :param folder: of the participant.
    :param participant: anonymous id.
    :param place: among all participants, from 0 on.
    :param clock_s: seconds since 1970.
    :raises InputError: if the study cannot be planned, another process has the session open, or
        the participant has begun another study or has another place.
    """

    def __init__(self, study: StudyFile, folder: Path, participant: str, place: int,
                 clock_s: Callable[[], float] = time.time) -> None:
        self.study, self.participant, self.place = study, participant, place
        self.items = session_of(study, place)
        self._ids = {item.id: item for item in self.items}
        self._clock_s = clock_s
        self.journal = SessionJournal(folder)
        begun = next((entry for entry in self.journal.entries
                      if entry['entry'] == SessionEvent.BEGUN), None)
        mine = {'participant': participant, 'place': place,
                'items': [item.id for item in self.items]}
        if begun is None:
            self._add(SessionEvent.BEGUN, **mine)
        elif {name: begun[name] for name in mine} != mine:
            self.journal.close()
            raise InputError('began with another plan', str(folder),
                             'put the study file back, or name another participant')

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.journal.close()

    def note_software(self, software: Mapping[str, str | None]) -> None:
        """Record the software versions with which the session begins or resumes."""
        self._add(SessionEvent.OPENED, software=dict(software))

    @property
    def done(self) -> frozenset[str]:
        """Return the ids of finished or skipped items."""
        found: set[str] = set()
        for entry in self.journal.entries:
            if entry['entry'] in (SessionEvent.FINISHED, SessionEvent.SKIPPED):
                found.add(entry['item'])
            elif entry['entry'] == SessionEvent.REPEATED:
                found.discard(entry['item'])
        return frozenset(found)

    @property
    def next_item(self) -> SessionItem | None:
        """Return the present item; None at the end, or once the session was ended."""
        if any(entry['entry'] == SessionEvent.ENDED for entry in self.journal.entries):
            return None
        done = self.done
        return next((item for item in self.items if item.id not in done), None)

    @property
    def language(self) -> str | None:
        """Return the language that the participant chose last; None before a choice."""
        return next((entry['language'] for entry in reversed(self.journal.entries)
                     if entry['entry'] == SessionEvent.LANGUAGE), None)

    def choose_language(self, language: str) -> None:
        """
        Record the participant's language.

        :raises InputError: if the study does not have it.
        """
        if language not in self.study.all_languages:
            raise InputError('is no language of this study', language[:20],
                             f'name {", ".join(self.study.all_languages)}')
        self._add(SessionEvent.LANGUAGE, language=language)

    @property
    def held_at(self) -> str | None:
        """Return the item after which the experimenter holds the session; None if not held."""
        last = next((entry for entry in reversed(self.journal.entries)
                     if entry['entry'] == SessionEvent.HELD), None)
        return None if last is None or not last['held'] else last['item']

    def hold(self, held: bool) -> None:
        """Hold the session after the present item, or release it."""
        item = self.next_item
        self._add(SessionEvent.HELD, held=held, item='' if item is None else item.id)

    def attempts(self, item: str) -> int:
        """Return how often an item was started."""
        return sum(entry['entry'] == SessionEvent.STARTED and entry['item'] == item
                   for entry in self.journal.entries)

    def start(self, run: str = '') -> int:
        """
        Record the start of the next item.

        :param run: name of the recording's folder, for a drive.
        :return: number of the attempt, from 1 on; unfinished attempts count.
        """
        item = self._now()
        attempt = self.attempts(item.id) + 1
        self._add(SessionEvent.STARTED, item=item.id, attempt=attempt, run=run)
        return attempt

    def questions(self, item: SessionItem) -> tuple[Question, ...]:
        """Return the questions of an item; empty without any."""
        return questions_of(self.study, item)

    def finish(self, answers: Mapping[str, object] | None = None, **told: object) -> SessionItem:
        """
        Record that the next item is finished: it is not asked again.

        :param answers: to its questions, as the participant gave them.
        :param told: further values, such as a drive's outcome.
        :raises InputError: if an answer is refused, or a consent is not given.
        """
        item = self._now()
        if isinstance(item.what, PracticeDrives):
            raise InputError('is no single thing', item.id, 'call practised')
        if isinstance(item.what, Page) and item.what.consent and told.get('agreed') is not True:
            raise InputError('needs consent', item.id, 'agree, or end the session')
        if isinstance(item.what, PlannedTrial) and not self.attempts(item.id):
            raise InputError('has not begun', item.id, 'start it first')
        taken = check_answers(self.questions(item), answers or {}, item.id)
        self._add(SessionEvent.FINISHED, item=item.id, answers=taken, **told)
        return item

    def practised(self, good: bool, **told: object) -> bool:
        """
        Record a practice drive.

        :param good: whether it met the criterion.
        :return: whether the practice is over.
        """
        item = self._now()
        if not isinstance(item.what, PracticeDrives):
            raise InputError('is no practice', item.id, 'finish it')
        self._add(SessionEvent.PRACTISED, item=item.id, good=good, **told)
        drives = self._practice_drives(item.id)
        practice = item.what.practice
        over = drives >= practice.at_least and (good or 0 < practice.at_most <= drives)
        if over:
            self._add(SessionEvent.FINISHED, item=item.id, answers={}, drives=drives,
                      criterion_met=good)
        return over

    def _practice_drives(self, item: str) -> int:
        """Return the number of drives of a practice since its start or last repeat."""
        drives = 0
        for entry in self.journal.entries:
            if entry.get('item') == item:
                drives += entry['entry'] == SessionEvent.PRACTISED
                drives *= entry['entry'] != SessionEvent.REPEATED
        return drives

    def abort(self, reason: str, item: str = '') -> None:
        """
        Record that the present attempt at an item does not count; the item is repeated.

        :param item: id of the item; the next one if empty.
        """
        self._add(SessionEvent.ABORTED, item=item or self._now().id, reason=reason)

    def skip(self, reason: str) -> None:
        """Skip the next item, for a reason."""
        if not reason.strip():
            raise InputError('needs a reason', self._now().id, 'say why it is left out')
        self._add(SessionEvent.SKIPPED, item=self._now().id, reason=reason)

    def repeat(self, item: str, reason: str) -> None:
        """
        Repeat a finished item; its earlier entries stay in the journal.

        With a trial, the questions after it are repeated too: they are about its last drive.
        """
        done = self.done
        if item not in self._ids or item not in done:
            raise InputError('is not done', item[:60], 'name an item that is')
        self._add(SessionEvent.REPEATED, item=item, reason=reason)
        what = self._ids[item].what
        if not isinstance(what, PlannedTrial):
            return
        for after in self.items:
            if after.trial == what.number and after.id in done and self.questions(after):
                self._add(SessionEvent.REPEATED, item=after.id, reason=reason)

    def note(self, text: str, **told: object) -> None:
        """Record a note of the experimenter."""
        self._add(SessionEvent.NOTE, text=text, **told)

    def mark(self, name: str, **told: object) -> None:
        """Record a marker of the experimenter or of a secondary task."""
        self._add(SessionEvent.MARKER, name=name, **told)

    def end(self, reason: str, **told: object) -> None:
        """End the session before its last item, for good."""
        self._add(SessionEvent.ENDED, reason=reason, **told)

    def _now(self) -> SessionItem:
        item = self.next_item
        if item is None:
            raise InputError('is over', f'session of {self.participant}', 'nothing is left to do')
        return item

    def _add(self, entry: SessionEvent, **values: object) -> None:
        self.journal.add({'entry': entry.value, 'at': self._clock_s(), **values})
