# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scripts a participant's session as a sequence of items."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from crgame_ros.study.file import Block, Break, Practice, Step, StepEntry, StudyFile
from crgame_ros.study.trial_plan import conditions_of, plan_trials, PlannedTrial
from crgame_ros.study.trial_settings import drawn, laid, TrialSettings


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


def session_of(study: StudyFile, place: int) -> tuple[SessionItem, ...]:
    """
    Return the session of a participant.

    :param place: among all participants, from 0 on.
    :raises InputError: if the study cannot be planned.
    """
    items: list[SessionItem] = [SessionItem('fields', Fields())] if study.fields else []
    items += _steps('before', study.before)
    trials = plan_trials(study, place)
    for block in study.blocks:
        items += _block(study, block, place,
                        [trial for trial in trials if trial.block == block.name])
    items += _steps('after', study.after)
    return tuple(items)


def drives_of(study: StudyFile) -> Iterator[tuple[str, TrialSettings]]:
    """Yield names and settings of all practices and conditions of a study, each once."""
    for block in study.blocks:
        if block.practice is not None:
            first = conditions_of(study, block)[0].settings
            settings = laid(study.settings, block.settings, block.practice.settings)
            yield f'{block.name}: practice', placed(settings, first)
        for condition in conditions_of(study, block):
            yield f'{block.name}: {condition.name}', condition.settings


def placed(settings: TrialSettings, trial: TrialSettings) -> TrialSettings:
    """Return practice settings with the game of the first trial, unless they have their own."""
    if settings.game is not None or settings.scenario is not None:
        return settings
    return replace(settings, game=trial.game, scenario=trial.scenario)


def _block(study: StudyFile, block: Block, place: int,
           trials: list[PlannedTrial]) -> Iterator[SessionItem]:
    yield from _steps(f'{block.name}/before', block.before)
    if block.practice is not None:
        settings = drawn(laid(study.settings, block.settings, block.practice.settings),
                         f'{study.seed} {place} practice {block.name}')
        if trials:
            settings = placed(settings, trials[0].condition.settings)
        yield SessionItem(f'{block.name}/practice', PracticeDrives(block.practice, settings))
    for trial in trials:
        name = f'{block.name}/{trial.place}'
        yield SessionItem(name, trial)
        yield from _steps(f'{name}/after', block.after_trial, trial.number)
        if block.break_every and trial.place % block.break_every == 0 and trial != trials[-1]:
            yield SessionItem(f'{name}/break', Break(block.break_minutes))
    yield from _steps(f'{block.name}/after', block.after)


def _steps(name: str, steps: tuple[StepEntry, ...],
           trial: int | None = None) -> Iterator[SessionItem]:
    for number, entry in enumerate(steps):
        yield SessionItem(f'{name}/{number + 1}', entry.step, trial)
