# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A participant's session: finished items, the next item, and resuming after any end."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
import time
from types import TracebackType
from typing import Self

from crgame_ros.errors import InputError
from crgame_ros.study.answer_condition import Exclusion
from crgame_ros.study.file import Page, StudyFile
from crgame_ros.study.followed_session import (
    exclusion_of,
    field_answers,
    followed,
    judging_question,
    last_answers,
)
from crgame_ros.study.groups import (
    allocate,
    Allocation,
    allocation_of,
    enrolled,
    enrolling,
    free_place,
)
from crgame_ros.study.question import Answer, asked_of, check_answers, Question
from crgame_ros.study.questionnaire import questionnaire_of, questions_of
from crgame_ros.study.session_journal import (
    chosen_language,
    done_items,
    first_of,
    how_ended,
    JournalEntry,
    SessionEvent,
    SessionJournal,
)
from crgame_ros.study.session_script import (
    Fields,
    is_driven,
    items_before_groups,
    PracticeDrives,
    session_of,
    SessionItem,
)
from crgame_ros.study.trial_plan import PlannedTrial


class ParticipantSession:
    """
    The progress of a session; every step is in the journal before it counts.

    :param folder: of the participant.
    :param participant: anonymous id.
    :param place: among all participants, from 0 on; by default the participant's own, or the
        first that is free.
    :param clock_s: seconds since 1970.
    :param group: that the experimenter gives, where the study wants one of a new participant.
    :param members: ids of those who drive together, this one among them, in the order of their
        seats; nobody for a participant who drives alone.
    :ivar allocation: to a group; None before it, and in a study without groups.
    :ivar partners: sessions of the others who drive together.
    :raises InputError: if the study cannot be planned, another process has the session open, or
        the participant has begun another study, or has another place, group or partner.
    """

    def __init__(self, study: StudyFile, folder: Path, participant: str, place: int | None = None,
                 clock_s: Callable[[], float] = time.time, *, group: str | None = None,
                 members: Sequence[str] = ()) -> None:
        self.study, self.participant = study, participant
        self._folder, self._clock_s = folder, clock_s
        self._members = tuple(members)
        self.partners: tuple[ParticipantSession, ...] = ()
        self.allocation: Allocation | None = None
        for name in study.group_names:
            session_of(study, 0, name)
        for block in study.blocks:
            if block.judged is not None:
                judging_question(study, block)
        self._planned: tuple[SessionItem, ...] = ()
        # The number of entries that the items follow from, and the items.
        self._followed: tuple[int, tuple[SessionItem, ...]] = -1, ()
        self.journal = SessionJournal(folder)
        try:
            self._begin(place, group)
            self._settle()
        except InputError:
            self.journal.close()
            raise

    def _begin(self, place: int | None, group: str | None) -> None:
        """Note the beginning, or take up what the journal has."""
        begun = first_of(self.journal.entries, SessionEvent.BEGUN)
        allocated = first_of(self.journal.entries, SessionEvent.ALLOCATED)
        self._check_given(group, begun)
        with enrolling(self._folder.parent):
            if place is None:
                place = free_place(self._folder.parent) if begun is None else begun['place']
            self.place = int(place)
            member = self._members.index(self.participant) if self._members else 0
            self._planned = session_of(self.study, self.place, member=member) \
                if self.study.groups is None else items_before_groups(self.study)
            mine = {'participant': self.participant, 'place': self.place,
                    'items': [item.id for item in self._planned]}
            if begun is None:
                self._add(SessionEvent.BEGUN, **mine, **({} if group is None else {
                    'group': group}), **({'members': self._members} if self._members else {}))
        if begun is not None and {name: begun.get(name) for name in mine} != mine:
            raise self._other_plan()
        if allocated is not None:
            allocation = self.allocation = allocation_of(allocated)
            if allocation.group not in self.study.group_names:
                raise self._other_plan()
            self._planned = session_of(self.study, allocation.place, allocation.group)
            if allocated['items'] != [item.id for item in self._planned]:
                raise self._other_plan()

    @property
    def items(self) -> tuple[SessionItem, ...]:
        """Return the items; of staircases those that are needed as far as the journal tells."""
        count, before = self._followed
        if count != len(self.journal.entries):
            place, group = (self.place, '') if self.allocation is None else (
                self.allocation.place, self.allocation.group)
            known = {item.id: item for item in before}
            # An item that stays the same stays the same object.
            self._followed = len(self.journal.entries), tuple(
                known[item.id] if known.get(item.id) == item else item for item in followed(
                    self.study, place, group, self._planned, self.journal.entries).items)
        return self._followed[1]

    def _other_plan(self) -> InputError:
        return InputError('began with another plan', str(self._folder),
                          'put the study file back, or name another participant')

    def _check_given(self, group: str | None, begun: JournalEntry | None) -> None:
        """Refuse other partners and a group where none is given, none where one is, or another."""
        together = self._members if begun is None else tuple(begun.get('members') or ())
        if together != self._members:
            raise InputError('began with ' + (' and '.join(together) or 'nobody'),
                             ' and '.join(self._members or (self.participant,)),
                             f'give --participant {",".join(together or (self.participant,))}')
        groups = self.study.groups
        if groups is None or groups.allocation != 'given':
            if group is not None:
                raise InputError('is not given by the experimenter in this study', group,
                                 'leave out --group')
            return
        names = f'one of {", ".join(groups.names)}'
        if begun is None and group is None:
            raise InputError('needs the group of a new participant', self.participant,
                             f'give --group, {names}')
        if group is not None and group not in groups.names:
            raise InputError('is no group of this study', group, f'give {names}')
        if begun is not None and group is not None and begun.get('group') != group:
            raise InputError(f'is in the group {begun.get("group")} already', self.participant,
                             'leave out --group: a group is given once')

    def _settle(self) -> None:
        """
        Exclude the participant, or allocate a group, as soon as what decides is in the journal.

        It is called again when a session is opened, so that nothing is lost between two entries.
        """
        if self._has_ended:
            return
        answers = last_answers(self.journal.entries)
        rule = exclusion_of(self.study, self.items, answers)
        if rule is not None:
            last = next(entry['item'] for entry in reversed(self.journal.entries)
                        if entry['entry'] == SessionEvent.FINISHED)
            self._add(SessionEvent.EXCLUDED, item=last, reason=rule.told, page=rule.page)
            self._leave_partners(rule.told)
        elif self._awaits_group and self.done >= {item.id for item in self.items}:
            self._allocate(field_answers(self.items, answers))

    @property
    def _awaits_group(self) -> bool:
        return self.study.groups is not None and self.allocation is None

    def _allocate(self, fields: Mapping[str, Answer]) -> None:
        groups = self.study.groups
        assert groups is not None
        given = next(entry.get('group') for entry in self.journal.entries
                     if entry['entry'] == SessionEvent.BEGUN)
        if groups.allocation == 'given' and given not in groups.names:
            raise self._other_plan()
        for field in self.study.fields:
            if field.name in groups.deciding_fields and field.refusal(fields.get(field.name)):
                raise InputError(f'has no answer to "{field.name}", which decides on the group',
                                 str(self.journal.path), 'put back the journal, or name another '
                                 'participant')
        with enrolling(self._folder.parent):
            others = [(each.dropped_out, each.allocation)
                      for each in enrolled(self._folder.parent)
                      if each.participant != self._folder.name]
            before = [(dropped_out, each) for dropped_out, each in others if each is not None]
            allocation = allocate(
                groups, self.study.seed, fields,
                [each for dropped_out, each in before if not dropped_out], len(before), given)
            items = session_of(self.study, allocation.place, allocation.group)
            self._add(SessionEvent.ALLOCATED, **asdict(allocation),
                      items=[item.id for item in items])
        # Only what is on the disk counts.
        self.allocation, self._planned, self._followed = allocation, items, (-1, ())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.journal.close()

    def note_software(self, software: Mapping[str, str | None]) -> None:
        """Record the software versions with which the session begins or resumes."""
        self._add(SessionEvent.OPENED, software=dict(software))

    def join(self, partners: Sequence['ParticipantSession']) -> None:
        """
        Drive together with others from now on; mend what a killed process left half done.

        A drive that one journal has and another has not is driven again.

        :param partners: sessions of the others, which join these as well.
        """
        self.partners = tuple(partners)
        all_of_them = (self, *partners)
        for partner in partners:
            partner.partners = tuple(each for each in all_of_them if each is not partner)
        for each in all_of_them:
            if each._has_ended:
                each._leave_partners('')
        for item in filter(is_driven, self.items):
            if len({(item.id in each.done, each.practice_drives(item.id))
                    for each in all_of_them}) > 1:
                for each in all_of_them:
                    each._repeat(item.id, 'the journals of those who drove together differ')

    def _leave_partners(self, reason: str) -> None:
        """End the sessions of those who cannot drive without this participant."""
        for partner in self.partners:
            if not partner._has_ended and any(
                    is_driven(item) and item.id not in partner.done for item in partner.items):
                partner._add(SessionEvent.ENDED, reason=': '.join(filter(None, (
                    f'{self.participant}, who drove too, takes part no longer', reason))))

    @property
    def done(self) -> frozenset[str]:
        """Return the ids of finished or skipped items."""
        return frozenset(done_items(self.journal.entries))

    @property
    def next_item(self) -> SessionItem | None:
        """Return the present item; None at the end, or once the session was ended."""
        if self._has_ended:
            return None
        done = self.done
        # If an allocation could not be noted, the item before it comes again.
        return next((item for item in self.items if item.id not in done),
                    self.items[-1] if self._awaits_group else None)

    @property
    def _has_ended(self) -> bool:
        return how_ended(self.journal.entries) is not None

    @property
    def planned_items(self) -> tuple[SessionItem, ...]:
        """Return all items; those of the first group as long as the own is not known."""
        return session_of(self.study, 0, self.study.group_names[0]) if self._awaits_group \
            else self.items

    @property
    def fields(self) -> Mapping[str, Answer]:
        """Return the participant's answers to the fields."""
        return field_answers(self.items, last_answers(self.journal.entries))

    @property
    def language(self) -> str | None:
        """Return the language that the participant chose last; None before a choice."""
        return chosen_language(self.journal.entries)

    @property
    def page_language(self) -> str:
        """Return the language of the participant's page."""
        return self.language or self.study.language

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
        last = first_of(reversed(self.journal.entries), SessionEvent.HELD)
        return None if last is None or not last['held'] else last['item']

    def hold(self, held: bool) -> None:
        """Hold the session after the present item, or release it."""
        item = self.next_item
        self._add(SessionEvent.HELD, held=held, item='' if item is None else item.id)

    def attempts(self, item: str) -> int:
        """Return how often an item was started."""
        return sum(entry['entry'] == SessionEvent.STARTED and entry['item'] == item
                   for entry in self.journal.entries)

    def repeats(self, item: str) -> int:
        """Return how often an item was repeated after it was done."""
        return sum(entry['entry'] == SessionEvent.REPEATED and entry['item'] == item
                   for entry in self.journal.entries)

    def start(self, run: str = '') -> int:
        """
        Record the start of the next item.

        :param run: name of the recording's folder, for a drive.
        :return: number of the attempt, from 1 on; unfinished attempts count.
        """
        item = self._now()
        attempt = self.attempts(item.id) + 1
        told = {'condition': item.what.condition.name} if isinstance(item.what, PlannedTrial) \
            and item.what.staircase is not None else {}
        self._add(SessionEvent.STARTED, item=item.id, attempt=attempt, run=run, **told)
        return attempt

    def questions(self, item: SessionItem) -> tuple[Question, ...]:
        """
        Return the questions of an item in the order in which they are shown; empty without any.

        Those are among them whose condition does not hold.
        """
        scale = questionnaire_of(self.study, item)
        if scale is None:
            return questions_of(self.study, item)
        return scale.ordered(f'{self.study.seed} {self.participant} {item.id} '
                             f'{self.repeats(item.id)}')

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
        shown = self.questions(item)
        fields = None if isinstance(item.what, Fields) else self.fields
        taken = check_answers(shown, answers or {}, item.id, fields)
        asked = asked_of(shown, taken, fields)
        if asked != questions_of(self.study, item):
            told['asked'] = [question.name for question in asked]
        self._add(SessionEvent.FINISHED, item=item.id, answers=taken, **told)
        self._settle()
        return item

    def excluded_by(self, item: SessionItem, answers: Mapping[str, object]) -> Exclusion | None:
        """
        Return the rule that would exclude the participant after some answers; None without one.

        :raises InputError: if an answer is refused.
        """
        taken = check_answers(self.questions(item), answers, item.id,
                              None if isinstance(item.what, Fields) else self.fields)
        return exclusion_of(self.study, self.items,
                            last_answers(self.journal.entries) | {item.id: taken})

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
        drives = self.practice_drives(item.id)
        practice = item.what.practice
        over = drives >= practice.at_least and (good or 0 < practice.at_most <= drives)
        if over:
            self._add(SessionEvent.FINISHED, item=item.id, answers={}, drives=drives,
                      criterion_met=good)
        return over

    def practice_drives(self, item: str) -> int:
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
        item = self._now()
        groups = self.study.groups
        if isinstance(item.what, Fields) and groups is not None and groups.deciding_fields:
            raise InputError('decides on the group', item.id,
                             'let it be answered, or end the session')
        for each in (self, *(self.partners if is_driven(item) else ())):
            each._add(SessionEvent.SKIPPED, item=item.id, reason=reason)
        self._settle()

    def repeat(self, item: str, reason: str) -> None:
        """
        Repeat a finished item; its earlier entries stay in the journal.

        With a trial, the questions after it are repeated too: they are about its last drive. All
        who drove together drive it again.
        """
        found = next((each for each in self.items if each.id == item), None)
        if found is None or item not in self.done:
            raise InputError('is not done', item[:60], 'name an item that is')
        for each in (self, *(self.partners if is_driven(found) else ())):
            each._repeat(item, reason)

    def _repeat(self, item: str, reason: str) -> None:
        done = self.done
        self._add(SessionEvent.REPEATED, item=item, reason=reason)
        what = next(each.what for each in self.items if each.id == item)
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
        self._leave_partners(reason)

    def _now(self) -> SessionItem:
        item = self.next_item
        if item is None:
            raise InputError('is over', f'session of {self.participant}', 'nothing is left to do')
        return item

    def _add(self, entry: SessionEvent, **values: object) -> None:
        self.journal.add({'entry': entry.value, 'at': self._clock_s(), **values})
