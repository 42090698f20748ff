# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Plans a participant's trials in order, with crossed conditions and combined settings."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import groupby, product

from crgame_ros.errors import InputError
from crgame_ros.study.file import Block, StudyFile
from crgame_ros.study.staircase import follow, ToldTrial, Track
from crgame_ros.study.trial_order import order_of, rows_of
from crgame_ros.study.trial_settings import drawn, Factor, laid, TrialSettings


@dataclass(frozen=True)
class Condition:
    """
    A combination of factor levels.

    :param levels: names of the block's factors, each with that of its level.
    :param settings: of its trials, which override those of study and block.
    """

    levels: tuple[tuple[str, str], ...]
    settings: TrialSettings

    @property
    def name(self) -> str:
        """Return its name, made of its levels."""
        return '/'.join(level for _, level in self.levels) or 'all'


@dataclass(frozen=True)
class PlannedTrial:
    """
    A planned trial.

    :param number: among all trials of the participant, from 1 on.
    :param block: name of its block.
    :param place: in its block, from 1 on.
    :param repetition: from 1 on.
    :param condition: its condition; of a staircase as far as the answers before it are known.
    :param staircase: name of its staircase; None in a block without.
    """

    number: int
    block: str
    place: int
    repetition: int
    condition: Condition
    staircase: str | None = None


def conditions_of(study: StudyFile, block: Block, group: str = '') -> tuple[Condition, ...]:
    """
    Return the crossed levels of a block's factors; the last factor changes fastest.

    :param group: whose settings they have, over those of the block; its level is not in the name.
    """
    factors = study.factors_of(block)
    return tuple(
        Condition(tuple((factor.name, level.name) for factor, level in
                        zip(factors, levels, strict=True)),
                  settings_in(study, block, group, *(level.settings for level in levels)))
        for levels in product(*(factor.levels for factor in factors)))


def settings_in(study: StudyFile, block: Block, group: str,
                *inner: TrialSettings) -> TrialSettings:
    """Return settings of a block's trials in a group, over all that are around them."""
    return laid(study.settings, block.settings, study.group_settings(group), *inner)


class BlockStaircases:
    """
    The staircases of a block: one of each combination of the factors besides the stepped one.

    :param block: that has a staircase.
    :param group: of the participant; empty in a study without groups.
    :ivar factor: whose levels are the steps.
    :ivar names: of the staircases: their levels of the other factors, or `all`.
    """

    def __init__(self, study: StudyFile, block: Block, group: str = '') -> None:
        assert block.staircase is not None
        self._study, self._block, self._group = study, block, group
        self._staircase, name = block.staircase, block.staircase.factor
        self.factor: Factor = next(each for each in study.factors if each.name == name)
        steps = self.factor.names
        whose: dict[str, int] = {}
        self._conditions: dict[tuple[int, int], Condition] = {}
        for condition in conditions_of(study, block, group):
            others = replace(condition, levels=tuple(
                each for each in condition.levels if each[0] != name))
            index = whose.setdefault(others.name, len(whose))
            self._conditions[index, steps.index(dict(condition.levels)[name])] = condition
        self.names = tuple(whose)
        self._places = {each.name: at for at, each in self._conditions.items()}

    def find(self, condition: str) -> tuple[int, int] | None:
        """Return the indices of staircase and level of a condition; None if it has another."""
        return self._places.get(condition)

    @property
    def most(self) -> int:
        """Return the greatest number of trials."""
        return len(self.names) * self._staircase.stop.at_most

    def follow(self, place: int, told: Mapping[int, ToldTrial],
               before: int) -> tuple[dict[str, Track], list[PlannedTrial]]:
        """
        Return the tracks by staircase, and the trials that are needed.

        :param place: of the participant.
        :param told: by the trials' places in the block.
        :param before: number of trials before the block.
        """
        start = drive_seed(self._study, place, self._group)
        tracks, found = follow(self._staircase, self.factor, len(self.names),
                               f'{start} staircases {self._block.name}', told)
        counts: dict[tuple[int, int], int] = {}
        trials = []
        for number, at in found.items():
            counts[at] = counts.get(at, 0) + 1
            trials.append(PlannedTrial(
                before + number, self._block.name, number, counts[at],
                _drawn(self._conditions[at], start, before + number), self.names[at[0]]))
        return dict(zip(self.names, tracks, strict=True)), trials


def block_rows(study: StudyFile) -> int:
    """
    Return the number of successive participants who have the same orders of conditions.

    They go through the orders of the blocks: a place has one of the blocks' orders and one of the
    conditions', and all combinations come equally often.
    """
    return rows_of(study.block_order, len(study.blocks), study.block_sequences)


def blocks_of(study: StudyFile, place: int, group: str = '') -> tuple[Block, ...]:
    """
    Return the blocks in the order of a participant.

    :param place: of the participant among all, or in the group, from 0 on.
    :param group: of the participant; empty in a study without groups.
    """
    names = [block.name for block in study.blocks]
    sequences = [[names.index(name) for name in sequence] for sequence in study.block_sequences]
    return tuple(study.blocks[index] for index in order_of(
        study.block_order, len(names), f'{study.seed} blocks', place, 0, sequences, group))


def plan_trials(study: StudyFile, place: int, group: str = '') -> tuple[PlannedTrial, ...]:
    """
    Plan all trials of a participant; of staircases the most, as if no answer counted.

    :param place: of the participant among all, or in the group, from 0 on.
    :param group: of the participant; empty in a study without groups.
    :raises InputError: if a block's sequence names an unknown condition.
    """
    trials: list[PlannedTrial] = []
    in_turn = place // block_rows(study)
    for block in blocks_of(study, place, group):
        if block.staircase is not None:
            trials += BlockStaircases(study, block, group).follow(place, {}, len(trials))[1]
            continue
        conditions = conditions_of(study, block, group)
        sequences = _sequences(block, [condition.name for condition in conditions])
        in_block = 0
        # Blocks with equally many conditions have orders of their own.
        seed = f'{study.seed}' if block is study.blocks[0] else f'{study.seed} {block.name}'
        for repetition in range(block.repetitions):
            for index in order_of(block.order, len(conditions), seed, in_turn, repetition,
                                  sequences, group):
                in_block += 1
                number = len(trials) + 1
                trials.append(PlannedTrial(
                    number, block.name, in_block, repetition + 1,
                    _drawn(conditions[index], drive_seed(study, place, group), number)))
    return tuple(trials)


def _drawn(condition: Condition, start: str, number: int) -> Condition:
    """Return a condition whose seed is drawn for a trial, if it asks for one."""
    return replace(condition, settings=drawn(condition.settings, f'{start} trial {number}'))


def orders_of(study: StudyFile,
              places: int) -> Iterator[tuple[str, int, tuple[PlannedTrial, ...]]]:
    """
    Yield group, place and trials of the first places in the orders, of each group.

    :param places: their number, of each group.
    :raises InputError: if the study cannot be planned.
    """
    for group, place in product(study.group_names, range(places)):
        yield group, place, plan_trials(study, place, group)


def told_trials(trials: Iterable[PlannedTrial]) -> Iterator[tuple[str, str, str]]:
    """Yield number, block and condition of trials as text; those of staircases as one."""
    for (block, stepped), group in groupby(trials, lambda each: (
            each.block, each.staircase is not None)):
        of_block = list(group)
        if not stepped:
            yield from ((str(each.number), block, each.condition.name) for each in of_block)
            continue
        names = list(dict.fromkeys(str(each.staircase) for each in of_block))
        count = '1 staircase' if len(names) == 1 else f'{len(names)} staircases'
        yield (f'{of_block[0].number}-{of_block[-1].number}', block,
               f'{count}, at most {len(of_block)} trials')


def drive_seed(study: StudyFile, place: int, group: str) -> str:
    """Return the beginning of the names by which seeds of a participant's drives are drawn."""
    return ' '.join(filter(None, (f'{study.seed} {place}', group)))


def _sequences(block: Block, names: list[str]) -> list[list[int]]:
    for number, sequence in enumerate(block.sequences):
        for name in sequence:
            if name not in names:
                raise InputError(f'names "{name}", which is no condition of the block',
                                 f'blocks: {block.name}: sequences[{number}]',
                                 f'name {", ".join(names)}')
    return [[names.index(name) for name in sequence] for sequence in block.sequences]
