# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Groups of participants: who takes part, and the places in groups and orders that are free."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import fcntl
from itertools import pairwise
import os
from pathlib import Path
import random
from typing import Annotated, Any, ClassVar, Literal

from crgame_ros.errors import InputError, refusing
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Listed, Within
from crgame_ros.study.local_text import ColumnName
from crgame_ros.study.question import Answer, ChoiceQuestion, Question
from crgame_ros.study.session_journal import (
    first_of,
    how_ended,
    JournalEntry,
    read_journal,
    SessionEvent,
)
from crgame_ros.study.trial_order import shuffled
from crgame_ros.study.trial_settings import Factor, Level

AllocationKind = Literal['permuted_blocks', 'minimisation', 'field', 'given']


@dataclass(frozen=True)
class Stratifier:
    """
    A field of the participant that divides people into strata.

    :param field: its name; its choices are the strata.
    :param cuts: of a number, in rising order: a stratum begins at each.
    """

    FORM: ClassVar[Form] = Form(short='field')

    field: ColumnName
    cuts: Annotated[tuple[float, ...], Listed(0, 20, 'cut')] = ()

    def check(self) -> None:
        """Refuse cuts that do not rise."""
        if list(self.cuts) != sorted(set(self.cuts)):
            raise InputError('has cuts that do not rise', '', 'give each once, in rising order')

    @property
    def ranges(self) -> tuple[str, ...]:
        """Return the names of the ranges between the cuts."""
        ends = [f'{cut:g}' for cut in self.cuts]
        return (f'below {ends[0]}', *(f'{low} to below {high}' for low, high in pairwise(ends)),
                f'from {ends[-1]}')

    def stratum_of(self, answer: Any) -> str:
        """Return the stratum of an answer."""
        return self.ranges[sum(answer >= cut for cut in self.cuts)] if self.cuts else str(answer)

    def check_field(self, fields: Mapping[str, Question], where: str) -> tuple[str, ...]:
        """
        Return all strata.

        :raises InputError: if the field is not one that divides people.
        """
        asked = fields.get(self.field)
        if asked is None:
            raise InputError(f'names the field "{self.field}", which is not there', where,
                             f'name {", ".join(fields) or "one of the study, under fields"}')
        if not asked.required or asked.when is not None:
            raise InputError(f'names the field "{self.field}", which may be left out', where,
                             'ask it of everybody: without "required: false" and "when"')
        if isinstance(asked.kind, ChoiceQuestion) and not asked.kind.several and not self.cuts:
            return tuple(asked.kind.texts)
        if self.cuts and hasattr(asked.kind, 'bounds'):
            return self.ranges
        raise InputError(f'names the field "{self.field}", which does not divide people', where,
                         'name a choice of one, or a number with "cuts"')


@dataclass(frozen=True)
class Groups:
    """
    Groups of participants: a factor between them.

    :param name: of the factor, and of its column in tables.
    :param levels: the groups, with their settings as levels of factors have them.
    :param allocation: `permuted_blocks` are random in each stratum (stratified block
        randomisation); `minimisation` is that of Pocock and Simon (1975); with `field` an answer
        decides; with `given` the experimenter does, by `crgame study run --group`.
    :param strata: fields that permuted blocks are stratified by, or whose imbalance is minimised.
    :param block_size: participants in a permuted block, a multiple of the number of groups; by
        default twice that number.
    :param probability: of a group that leaves the least imbalance, for `minimisation`.
    :param field: that decides: a choice named as the groups are, or a number whose ranges between
        the cuts are the groups in their order.
    """

    name: ColumnName
    levels: Annotated[tuple[Level, ...], Listed(2, 20, 'group', 'name')]
    allocation: AllocationKind = 'permuted_blocks'
    strata: Annotated[tuple[Stratifier, ...], Listed(0, 10, 'field', 'field')] = ()
    block_size: Annotated[int, Within(2, 1000)] | None = None
    probability: Annotated[float, Within(0.5, 1.0)] = 0.8
    field: Stratifier | None = None

    def check(self) -> None:
        """Refuse keys of another kind of allocation, and blocks without balance."""
        if (self.allocation == 'field') != (self.field is not None):
            raise InputError('has "field" without "allocation: field", or the other way round', '',
                             'give both or none')
        if self.strata and self.allocation in ('field', 'given'):
            raise InputError(f'has "strata" with "allocation: {self.allocation}"', '',
                             'leave "strata" out: nothing is drawn')
        if self.allocation == 'minimisation' and not self.strata:
            raise InputError('minimises nothing', '', 'give "strata"')
        if self.block_size is not None and (self.allocation != 'permuted_blocks'
                                            or self.block_size % len(self.levels)):
            raise InputError(f'has "block_size: {self.block_size}"', '',
                             f'give a multiple of {len(self.levels)}, only with '
                             '"allocation: permuted_blocks"')

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the groups."""
        return tuple(level.name for level in self.levels)

    @property
    def factor(self) -> Factor:
        """Return the groups as a factor."""
        return Factor(self.name, self.levels)

    @property
    def deciding_fields(self) -> tuple[str, ...]:
        """Return the names of the fields that the allocation needs."""
        found = (*self.strata, *((self.field,) if self.field is not None else ()))
        return tuple(each.field for each in found)

    @property
    def told(self) -> str:
        """Return how the groups are formed, in words."""
        strata = ', '.join(each.field for each in self.strata)
        if self.allocation == 'permuted_blocks':
            size = f'randomly permuted blocks of {self.size_of_blocks}'
            return f'{size}, stratified by {strata}' if strata else size
        if self.allocation == 'minimisation':
            return (f'minimisation over {strata} (Pocock and Simon 1975): a group that leaves the '
                    f'least imbalance is taken with probability {self.probability:g}')
        if self.field is not None:
            return f'the participants’ own {self.field.field}, without randomisation'
        return 'as the experimenter gives them'

    @property
    def size_of_blocks(self) -> int:
        """Return the number of participants in a permuted block."""
        return self.block_size or 2 * len(self.levels)

    def check_fields(self, fields: Mapping[str, Question]) -> None:
        """
        Refuse fields that are not asked, or do not divide people.

        :raises InputError: naming the key.
        """
        for number, each in enumerate(self.strata):
            each.check_field(fields, f'groups: strata[{number}]')
        if self.field is None:
            return
        found = self.field.check_field(fields, 'groups: field')
        if len(found) != len(self.levels) or not self.field.cuts and set(found) != set(self.names):
            raise InputError(f'has the strata {", ".join(found)}', 'groups: field',
                             f'give as many as groups, and name choices as them: '
                             f'{", ".join(self.names)}')

    def strata_of(self, answers: Mapping[str, Answer]) -> dict[str, str]:
        """Return a participant's stratum of each field, by the field's name."""
        return {each.field: each.stratum_of(answers.get(each.field)) for each in self.strata}


@dataclass(frozen=True)
class Allocation:
    """
    A participant's allocation to a group.

    :param group: its name.
    :param place: in the orders of the group, from 0 on.
    :param strata: of the participant, by field.
    :param slot: in the permuted blocks of the stratum, from 0 on; None without blocks.
    """

    group: str
    place: int
    strata: Mapping[str, str]
    slot: int | None = None


def allocate(groups: Groups, seed: int, answers: Mapping[str, Answer],
             others: Sequence[Allocation], drawn_before: int, given: str | None = None
             ) -> Allocation:
    """
    Allocate the next participant; equal arguments give equal allocations.

    :param seed: of the study.
    :param answers: of the participant to the fields.
    :param others: of all participants that have not dropped out: what a drop-out leaves is free.
    :param drawn_before: number of earlier allocations, those of drop-outs too; numbers the draw
        of minimisation.
    :param given: the group that the experimenter has given.
    """
    strata, slot = groups.strata_of(answers), None
    if groups.allocation == 'given':
        assert given is not None
        group = given
    elif groups.field is not None:
        stratum = groups.field.stratum_of(answers.get(groups.field.field))
        group = groups.names[groups.field.ranges.index(stratum)] if groups.field.cuts else stratum
    elif groups.allocation == 'permuted_blocks':
        taken = {each.slot for each in others if each.strata == strata}
        slot = first_free(taken)
        group = permuted_group(groups, seed, strata, slot)
    else:
        group = minimising_group(groups, seed, strata, others, drawn_before)
    return Allocation(group, first_free({each.place for each in others if each.group == group}),
                      strata, slot)


def first_free(taken: Collection[object]) -> int:
    """Return the least number from 0 on that is not taken."""
    return next(number for number in range(len(taken) + 1) if number not in taken)


def permuted_group(groups: Groups, seed: int, strata: Mapping[str, str], slot: int) -> str:
    """Return the group of a slot in the permuted blocks of a stratum."""
    size = groups.size_of_blocks
    stratum = ', '.join(f'{field} {strata[field]}' for field in sorted(strata))
    order = shuffled(size, f'{seed} {groups.name} [{stratum}] block {slot // size}')
    return groups.names[order[slot % size] % len(groups.levels)]


def minimising_group(groups: Groups, seed: int, strata: Mapping[str, str],
                     others: Sequence[Allocation], drawn_before: int) -> str:
    """
    Return the group by minimisation (Pocock and Simon, Biometrics 31, 1975).

    The imbalance that a group would leave is the sum over fields of the range of the groups'
    numbers of people in the participant's stratum of the field. One of the groups that leave the
    least is taken with the stated probability, another one otherwise.
    """
    def imbalance(group: str) -> int:
        total = 0
        for field, stratum in strata.items():
            counts = dict.fromkeys(groups.names, 0)
            counts[group] += 1
            for each in others:
                counts[each.group] += each.strata.get(field) == stratum
            total += max(counts.values()) - min(counts.values())
        return total

    left = {name: imbalance(name) for name in groups.names}
    best = [name for name in groups.names if left[name] == min(left.values())]
    rest = [name for name in groups.names if name not in best]
    rng = random.Random(f'{seed} {groups.name} minimisation {drawn_before}')
    chosen = best if not rest or rng.random() < groups.probability else rest
    return chosen[int(rng.random() * len(chosen))]


@dataclass(frozen=True)
class Enrolment:
    """
    What a journal says of its participant's part in the study.

    :param participant: id.
    :param place: among all, from 0 on.
    :param dropped_out: whether the participant was excluded, or the session ended for good: the
        place is free again.
    :param allocation: to a group; None before it, and in studies without groups.
    """

    participant: str
    place: int
    dropped_out: bool = False
    allocation: Allocation | None = None


def read_enrolment(folder: Path) -> Enrolment | None:
    """Return the enrolment of the participant of a folder; None before the session has begun."""
    entries = read_journal(folder)
    begun = first_of(entries, SessionEvent.BEGUN)
    if begun is None:
        return None
    allocated = first_of(entries, SessionEvent.ALLOCATED)
    return Enrolment(folder.name, begun['place'], how_ended(entries) is not None,
                     None if allocated is None else allocation_of(allocated))


def allocation_of(entry: JournalEntry) -> Allocation:
    """Return the allocation that a journal's entry holds."""
    strata, slot = entry.get('strata'), entry.get('slot')
    return Allocation(str(entry['group']), int(str(entry['place'])),
                      {str(field): str(stratum) for field, stratum in strata.items()}
                      if isinstance(strata, dict) else {}, slot if isinstance(slot, int) else None)


def enrolled(participants: Path) -> list[Enrolment]:
    """
    Return all participants who have begun, in the order of their places.

    :param participants: folder with a folder of each.
    """
    paths = sorted(filter(Path.is_dir, participants.iterdir())) if participants.is_dir() else ()
    return sorted((found for path in paths if (found := read_enrolment(path)) is not None),
                  key=lambda each: (each.place, each.participant))


def free_place(participants: Path) -> int:
    """Return the first place among all that is free, from 0 on."""
    return first_free({each.place for each in enrolled(participants) if not each.dropped_out})


@contextmanager
def enrolling(participants: Path) -> Iterator[None]:
    """
    Hold the lock of a study's participants while a place or a group is chosen and noted.

    :param participants: folder with a folder of each; must exist.
    :raises InputError: if it cannot be locked.
    """
    with refusing('cannot be opened', participants, 'make the folder readable'):
        held = os.open(participants, os.O_RDONLY | os.O_DIRECTORY)
    try:
        # Others hold it for as long as it takes to read the journals and to add a line.
        fcntl.flock(held, fcntl.LOCK_EX)
        yield
    finally:
        os.close(held)
