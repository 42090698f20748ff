# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A conducted study: its folder, and what the journals of its participants hold."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
import json
from pathlib import Path
from typing import Literal

from crgame_ros.errors import InputError
from crgame_ros.recording.run_folder import PARTICIPANTS, STUDY_FILE
from crgame_ros.study.file import load_study, StudyFile
from crgame_ros.study.folder import WITHDRAWALS
from crgame_ros.study.followed_session import failed_checks, followed, last_answers
from crgame_ros.study.groups import Allocation, allocation_of
from crgame_ros.study.question import Answer
from crgame_ros.study.questionnaire import questions_of
from crgame_ros.study.session_journal import (
    chosen_language,
    done_items,
    first_of,
    how_ended,
    JournalEntry,
    read_journal,
    SessionEvent,
    way_of_end,
)
from crgame_ros.study.session_script import items_before_groups, session_of, SessionItem
from crgame_ros.study.staircase import Track
from crgame_ros.study.trial_plan import PlannedTrial

DATA = 'data'
Ending = Literal['finished', 'aborted', 'lost', 'open']
Part = Literal['completed', 'excluded', 'declined', 'ended', 'under way']


@dataclass(frozen=True)
class TrialAttempt:
    """
    An attempt at a trial.

    :param item: id of the session's item.
    :param trial: the planned trial.
    :param attempt: its number, from 1 on.
    :param folder: of its recording; None if the journal names none.
    :param started_at: wall clock [s since 1970]
    :param ended_at: likewise; None without an end.
    :param ending: how it ended; `lost` means without an end, but with later entries.
    :param told: the content of its last entry.
    """

    item: str
    trial: PlannedTrial
    attempt: int
    folder: Path | None
    started_at: float
    ended_at: float | None = None
    ending: Ending = 'open'
    told: JournalEntry | None = None

    def says(self, key: str) -> object:
        """Return a value of its last entry by key; None without one."""
        return None if self.told is None else self.told.get(key)


@dataclass(frozen=True)
class AnsweredItem:
    """
    The last answers to an item's questions.

    :param item: of the session.
    :param answers: by question.
    :param at: wall clock [s since 1970]
    :param told: the content of the entry: when they were shown, and each answer's time.
    :param after: the last finished attempt at the trial before it; None elsewhere.
    """

    item: SessionItem
    answers: Mapping[str, Answer]
    at: float
    told: JournalEntry
    after: TrialAttempt | None

    @property
    def attempt(self) -> int | None:
        """Return the number of that attempt."""
        return None if self.after is None else self.after.attempt


@dataclass(frozen=True)
class ParticipantRecord:
    """
    The content of a participant's journal.

    :param id: anonymous.
    :param place: among all participants, from 0 on.
    :param folder: of the participant.
    :param study: of the session.
    :param items: of the session.
    :param entries: of the journal.
    :param allocation: to a group; None before it, and in a study without groups.
    :param members: ids of those who drove together, in the order of their seats; else empty.
    :param tracks: of the staircases, by block and staircase.
    """

    id: str  # noqa: A003
    place: int
    folder: Path
    study: StudyFile
    items: Mapping[str, SessionItem]
    entries: tuple[JournalEntry, ...]
    allocation: Allocation | None = None
    members: tuple[str, ...] = ()
    tracks: Mapping[tuple[str, str], Track] = field(default_factory=dict)

    @property
    def recordings(self) -> Path:
        """Return the folder of the participant that has the recordings."""
        return self.folder.parent / self.members[0] if self.members else self.folder

    @cached_property
    def attempts(self) -> tuple[TrialAttempt, ...]:
        """Return all attempts at trials, in their order."""
        return tuple(self._attempts())

    @cached_property
    def counted(self) -> dict[str, TrialAttempt]:
        """
        Return the attempts that count, by item: the last finished ones.

        An item that was skipped in the end does not count, even if it was driven before. Nothing
        counts of a participant who was excluded.
        """
        if self.exclusion is not None:
            return {}
        found = {each.item: each for each in self.attempts if each.ending == 'finished'}
        for entry in self.entries:
            if entry['entry'] == SessionEvent.SKIPPED:
                last = found.get(entry.get('item', ''))
                if last is not None and (last.ended_at or 0.0) <= entry['at']:
                    del found[last.item]
        return dict(sorted(found.items(), key=lambda each: each[1].trial.number))

    @cached_property
    def to_repeat(self) -> frozenset[str]:
        """Return the items whose requested repeat has not been driven yet."""
        repeated = frozenset(entry['item'] for entry in self.entries
                             if entry['entry'] == SessionEvent.REPEATED)
        return repeated.difference(done_items(self.entries))

    @cached_property
    def answered(self) -> tuple[AnsweredItem, ...]:
        """Return each item's last answers, in the order of the session."""
        found: dict[str, AnsweredItem] = {}
        driven: dict[int, TrialAttempt | None] = {}
        for entry in self.entries:
            item = self.items.get(entry.get('item', ''))
            if entry['entry'] != SessionEvent.FINISHED or item is None:
                continue
            if isinstance(item.what, PlannedTrial):
                driven[item.what.number] = next(
                    (each for each in self.attempts if each.told is entry), None)
            elif entry.get('answers'):
                found[item.id] = AnsweredItem(
                    item, self._valid(item, entry['answers']), entry['at'], entry,
                    None if item.trial is None else driven.get(item.trial))
        return tuple(found[name] for name in self.items if name in found)

    def _valid(self, item: SessionItem, answers: Mapping[str, Answer]) -> dict[str, Answer]:
        """Return answers by question; one that a question does not take is missing."""
        return {question.name: None if question.kind.refusal(answer) else answer
                for question in questions_of(self.study, item) if question.name in answers
                for answer in (answers[question.name],)}

    @property
    def begun_at(self) -> float:
        """Return when the session began [s since 1970]."""
        return float(self.entries[0]['at'])

    @property
    def software(self) -> list[dict[str, object]]:
        """Return the software versions that ran the session, each once, in order."""
        found: list[dict[str, object]] = []
        for entry in self.entries:
            if entry['entry'] == SessionEvent.OPENED and entry.get('software') not in (
                    None, *found):
                found.append(entry['software'])
        return found

    @property
    def ended_at(self) -> float:
        """Return the time of the last entry [s since 1970]."""
        return float(self.entries[-1]['at'])

    @property
    def complete(self) -> bool:
        """Return whether every item is finished or skipped, and no rule has excluded anybody."""
        if self.exclusion is not None or self._awaits_group:
            return False
        return done_items(self.entries).keys() >= self.items.keys()

    @property
    def group(self) -> str:
        """Return the name of the participant's group; empty without one."""
        return '' if self.allocation is None else self.allocation.group

    @property
    def _awaits_group(self) -> bool:
        return self.study.groups is not None and self.allocation is None

    @property
    def exclusion(self) -> JournalEntry | None:
        """Return the entry by which a rule has excluded the participant; None without one."""
        ended = how_ended(self.entries)
        return ended if ended is not None and ended['entry'] == SessionEvent.EXCLUDED else None

    @property
    def part(self) -> Part:
        """Return the participant's part in the study: how far it went, or how it ended."""
        return way_of_end(self.entries) or ('completed' if self.complete else 'under way')

    @property
    def failed_checks(self) -> list[str]:
        """Return the attention checks that failed, as item and question."""
        return failed_checks(self.study, self.items.values(), last_answers(self.entries))

    @property
    def trials_planned(self) -> int:
        """
        Return the number of trials in the session; of the first group before an allocation.

        A staircase that has not ended counts with its most trials.
        """
        items = session_of(self.study, 0, self.study.group_names[0]) if self._awaits_group \
            else self.items.values()
        return sum(isinstance(item.what, PlannedTrial) for item in items)

    @property
    def language(self) -> str | None:
        """Return the language that the participant chose last; None without a choice."""
        return chosen_language(self.entries)

    def _attempts(self) -> Iterator[TrialAttempt]:
        openly: TrialAttempt | None = None
        for entry in self.entries:
            item = self.items.get(entry.get('item', ''))
            if item is None or not isinstance(item.what, PlannedTrial):
                continue
            kind = entry['entry']
            if kind == SessionEvent.STARTED:
                if openly is not None:
                    yield replace(openly, ending='lost')
                openly = TrialAttempt(item.id, item.what, int(entry.get('attempt', 1)),
                                      self._run(entry), float(entry['at']))
            elif openly is not None and openly.item == item.id and kind in (
                    SessionEvent.FINISHED, SessionEvent.ABORTED):
                yield replace(
                    openly, folder=self._run(entry) or openly.folder, ended_at=float(entry['at']),
                    ending='finished' if kind == SessionEvent.FINISHED else 'aborted', told=entry)
                openly = None
        if openly is not None:
            yield openly

    def _run(self, entry: JournalEntry) -> Path | None:
        """Return the folder of a recording, if it is one of those who drove together."""
        name = entry.get('run')
        if not name or '..' in Path(name).parts or Path(name).is_absolute():
            return None
        return self.recordings / name


def read_participant(study: StudyFile, folder: Path) -> ParticipantRecord | None:
    """
    Read a participant's journal, also while the session goes on.

    :return: None if the participant has not begun.
    :raises InputError: if it is of another study.
    """
    entries = tuple(read_journal(folder))
    begun = first_of(entries, SessionEvent.BEGUN)
    if begun is None:
        return None
    allocated = first_of(entries, SessionEvent.ALLOCATED)
    members = tuple(begun.get('members') or ())
    allocation: Allocation | None = None
    place, group = begun['place'], ''
    if allocated is not None:
        allocation = allocation_of(allocated)
        place, group = allocation.place, allocation.group
        items = session_of(study, place, group) if group in study.group_names else ()
    elif study.groups is not None:
        items = items_before_groups(study)
    else:
        member = members.index(begun['participant']) if members else 0
        items = session_of(study, place, member=member)
    if [item.id for item in items] != (allocated or begun)['items']:
        raise InputError('began with another plan than that of the study file', str(folder),
                         'put back the study file that the sessions were run with')
    session = followed(study, place, group, items, entries)
    return ParticipantRecord(begun['participant'] or folder.name, begun['place'], folder, study,
                             {item.id: item for item in session.items}, entries, allocation,
                             members, session.tracks)


class ConductedStudy:
    """
    A study's folder, as created by `crgame study run`.

    :ivar study_path: of the copied study file.
    :raises InputError: if it holds no study.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.study_path = path / STUDY_FILE
        if not self.study_path.is_file():
            raise InputError('holds no study' if path.exists() else 'there is no such folder',
                             str(path), 'name the folder that `crgame study run` has made')
        self.study: StudyFile = load_study(self.study_path)

    @property
    def data(self) -> Path:
        """Return the folder of the study's data."""
        return self.path / DATA

    @property
    def withdrawn_groups(self) -> list[str]:
        """Return the group of each participant whose data were deleted; an empty name for none."""
        log = self.path / WITHDRAWALS
        lines = log.read_text('utf-8').splitlines() if log.is_file() else ()
        return [json.loads(line).get('group', '') for line in lines]

    def participants(self) -> list[ParticipantRecord]:
        """
        Read the journals of all started participants, in the order of their names.

        :raises InputError: if a participant began another study.
        """
        folder = self.path / PARTICIPANTS
        paths = sorted(filter(Path.is_dir, folder.iterdir())) if folder.is_dir() else ()
        return [found for path in paths
                if (found := read_participant(self.study, path)) is not None]

    def relative(self, path: Path) -> str:
        """Return a file's path relative to the study's folder, as in the tables."""
        return path.relative_to(self.path).as_posix()
