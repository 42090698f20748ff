# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scripts a participant's session as a sequence of items."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

from crgame_ros.errors import InputError
from crgame_ros.study.file import Block, Break, Practice, Step, StepEntry, StudyFile
from crgame_ros.study.trial_plan import (
    blocks_of,
    conditions_of,
    drive_seed,
    plan_trials,
    PlannedTrial,
    settings_in,
)
from crgame_ros.study.trial_settings import drawn, TrialSettings


@dataclass(frozen=True)
class Fields:
    """The questions to a participant at the start."""


@dataclass(frozen=True)
class PracticeDrives:
    """
    Practice drives before a block.

    :param practice: number of drives and criterion.
    :param settings: of the drives.
    """

    practice: Practice
    settings: TrialSettings


@dataclass(frozen=True)
class SessionItem:
    """
    One item of a session.

    :param id: its id, the same in each process that reads the same study.
    :param what: its content.
    :param trial: the trial before it, for answers; None elsewhere.
    """

    id: str  # noqa: A003
    what: Step | Fields | PracticeDrives | PlannedTrial
    trial: int | None = None


def items_before_groups(study: StudyFile) -> tuple[SessionItem, ...]:
    """Return the items that come before a participant's group is known."""
    return (*((SessionItem('fields', Fields()),) if study.fields else ()),
            *_steps('before', study.before))


def session_of(study: StudyFile, place: int, group: str = '',
               member: int = 0) -> tuple[SessionItem, ...]:
    """
    Return the session of a participant.

    :param place: among all participants, or in the group, from 0 on.
    :param group: of the participant; empty in a study without groups.
    :param member: number of the participant among those who drive together, from 0 on.
    :raises InputError: if the study cannot be planned.
    """
    items = list(items_before_groups(study))
    trials = plan_trials(study, place, group)
    for block in blocks_of(study, place, group):
        items += _block(study, block, place, group,
                        [trial for trial in trials if trial.block == block.name])
    items += _steps('after', study.after, group=group)
    return tuple(_seated(item, member) for item in items)


def settings_of(item: SessionItem) -> TrialSettings | None:
    """Return the settings of an item that is driven; None for others."""
    if isinstance(item.what, PlannedTrial):
        return item.what.condition.settings
    return item.what.settings if isinstance(item.what, PracticeDrives) else None


def is_driven(item: SessionItem) -> bool:
    """Return whether an item consists of drives."""
    return settings_of(item) is not None


def _seated(item: SessionItem, member: int) -> SessionItem:
    """Return an item for one of several participants in a drive, numbered from 0 on."""
    settings, what = settings_of(item), item.what
    if settings is None or settings.seats is None:
        return item
    own = replace(settings, seat=settings.seats[member])
    if isinstance(what, PlannedTrial):
        return replace(item, what=replace(what, condition=replace(what.condition, settings=own)))
    assert isinstance(what, PracticeDrives)
    return replace(item, what=replace(what, settings=own))


def members_of(study: StudyFile) -> int:
    """
    Return the number of participants who drive together; 1 if each drives alone.

    :raises InputError: if it differs between the drives, or nobody can say who is in which group.
    """
    counts = {name: len(settings.seats or ('',)) for name, settings in drives_of(study)}
    one, *others = sorted(counts, key=lambda name: counts[name])
    if others and counts[one] != counts[others[-1]]:
        raise InputError(f'has other "seats" than {others[-1]}', one,
                         'let as many people take part in all drives')
    if counts[one] > 1 and study.groups is not None:
        raise InputError('is for participants who drive alone', 'groups',
                         'leave out "groups", or "seats"')
    judged = next((block.name for block in study.blocks if block.judged is not None), None)
    if counts[one] > 1 and judged is not None:
        raise InputError('is ruled by successes, which are those of one participant',
                         f'blocks: {judged}', 'leave out "staircase" and "stop", or "seats"')
    return counts[one]


def drives_of(study: StudyFile) -> Iterator[tuple[str, TrialSettings]]:
    """Yield names and settings of all practices and conditions of a study, each once."""
    for group, block in product(study.group_names, study.blocks):
        name = f'{group}: {block.name}' if group else block.name
        conditions = conditions_of(study, block, group)
        if block.practice is not None:
            settings = settings_in(study, block, group, block.practice.settings)
            yield f'{name}: practice', placed(settings, conditions[0].settings)
        for condition in conditions:
            yield f'{name}: {condition.name}', condition.settings


def placed(settings: TrialSettings, trial: TrialSettings) -> TrialSettings:
    """Return practice settings with the game of the first trial, unless they have their own."""
    if settings.game is not None or settings.scenario is not None:
        return settings
    return replace(settings, game=trial.game, scenario=trial.scenario)


def _block(study: StudyFile, block: Block, place: int, group: str,
           trials: list[PlannedTrial]) -> Iterator[SessionItem]:
    yield from _steps(f'{block.name}/before', block.before, group=group)
    if block.practice is not None:
        settings = drawn(settings_in(study, block, group, block.practice.settings),
                         f'{drive_seed(study, place, group)} practice {block.name}')
        if trials:
            settings = placed(settings, trials[0].condition.settings)
        yield SessionItem(f'{block.name}/practice', PracticeDrives(block.practice, settings))
    for trial in trials:
        name = f'{block.name}/{trial.place}'
        yield SessionItem(name, trial)
        yield from _steps(f'{name}/after', block.after_trial, trial.number, group)
        if block.break_every and trial.place % block.break_every == 0 and trial != trials[-1]:
            yield SessionItem(f'{name}/break', Break(block.break_minutes))
    yield from _steps(f'{block.name}/after', block.after, group=group)


def _steps(name: str, steps: tuple[StepEntry, ...],
           trial: int | None = None, group: str = '') -> Iterator[SessionItem]:
    for number, entry in enumerate(steps):
        # The numbers in the ids are those of the file, the same for all groups.
        if not entry.groups or group in entry.groups:
            yield SessionItem(f'{name}/{number + 1}', entry.step, trial)
