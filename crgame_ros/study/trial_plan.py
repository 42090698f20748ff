# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Plans a participant's trials in order, with crossed conditions and combined settings."""

from dataclasses import dataclass, replace
from itertools import product

from crgame_ros.errors import InputError
from crgame_ros.study.file import Block, StudyFile
from crgame_ros.study.trial_order import order_of
from crgame_ros.study.trial_settings import drawn, laid, Level, TrialSettings


@dataclass(frozen=True)
class Condition:
    """
    A combination of factor levels.

    :param levels: one of each factor of the block, by the factor's name.
    :param settings: of its trials, which override those of study and block.
    """

    levels: tuple[tuple[str, Level], ...]
    settings: TrialSettings

    @property
    def name(self) -> str:
        """Return its name, made of its levels."""
        return '/'.join(level.name for _, level in self.levels) or 'all'


@dataclass(frozen=True)
class PlannedTrial:
    """
    A planned trial.

    :param number: among all trials of the participant, from 1 on.
    :param block: name of its block.
    :param place: in its block, from 1 on.
    :param repetition: from 1 on.
    :param condition: its condition.
    """

    number: int
    block: str
    place: int
    repetition: int
    condition: Condition


def conditions_of(study: StudyFile, block: Block) -> tuple[Condition, ...]:
    """Return the crossed levels of a block's factors; the last factor changes fastest."""
    factors = study.factors_of(block)
    return tuple(
        Condition(tuple((factor.name, level) for factor, level in
                        zip(factors, levels, strict=True)),
                  laid(study.settings, block.settings, *(level.settings for level in levels)))
        for levels in product(*(factor.levels for factor in factors)))


def plan_trials(study: StudyFile, place: int) -> tuple[PlannedTrial, ...]:
    """
    Plan all trials of a participant.

    :param place: of the participant among all, from 0 on.
    :raises InputError: if a block's sequence names an unknown condition.
    """
    trials: list[PlannedTrial] = []
    for block in study.blocks:
        conditions = conditions_of(study, block)
        sequences = _sequences(block, [condition.name for condition in conditions])
        in_block = 0
        for repetition in range(block.repetitions):
            for index in order_of(block.order, len(conditions), study.seed, place, repetition,
                                  sequences):
                in_block += 1
                number, condition = len(trials) + 1, conditions[index]
                settings = drawn(condition.settings, f'{study.seed} {place} trial {number}')
                trials.append(PlannedTrial(number, block.name, in_block, repetition + 1,
                                           replace(condition, settings=settings)))
    return tuple(trials)


def _sequences(block: Block, names: list[str]) -> list[list[int]]:
    for number, sequence in enumerate(block.sequences):
        for name in sequence:
            if name not in names:
                raise InputError(f'names "{name}", which is no condition of the block',
                                 f'blocks: {block.name}: sequences[{number}]',
                                 f'name {", ".join(names)}')
    return [[names.index(name) for name in sequence] for sequence in block.sequences]
