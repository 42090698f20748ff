# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The settings of a trial, which cascade from the study to its blocks, levels and trials."""

from collections import Counter
from dataclasses import dataclass, fields, replace
from pathlib import Path
import random
from typing import Annotated, ClassVar, Literal

from crgame_ros.errors import InputError
from crgame_ros.game.events import EventList
from crgame_ros.game.instruments_spec import InstrumentsSpec
from crgame_ros.game.task_spec import TaskList, TaskSpec
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Listed, Named, Within, Wording
from crgame_ros.study.local_text import ColumnName, LocalText, Name


@dataclass(frozen=True)
class TrialSettings:
    """
    Settings of trials; a setting that is left out keeps the value of the outer settings.

    :param game: game file.
    :param scenario: CommonRoad file instead of the game's; without a game, the participant starts
        near its first AV.
    :param seat: the participant's vehicle; the game's first human by default. An AV drives itself
        until the participant takes it over.
    :param seats: the vehicles of several participants who drive together, instead of `seat`: one
        of each, in the order in which `--participant` names them.
    :param confederate: a human of the game whom the experimenter drives.
    :param planner: of all AVs, instead of the game's.
    :param options: of that planner.
    :param perception: file with the `perception` of all AVs, `perfect`, or `own` for the game's.
    :param traffic: file with the `traffic`, `none`, or `own` for the game's.
    :param seed: of everything random; `each` draws one for each drive of each participant.
    :param duration: maximum simulated time [s]
    :param view: the participant's view at the start.
    :param map: whether the map is shown beside the view.
    :param plans: whether AVs' plans and perceptions may be shown.
    :param names: whether the names of planners are shown.
    :param sound: whether sound is on.
    :param instruments: streams and triggers, instead of the game's.
    :param photodiode: corner of the view that is white while a light or a request is shown.
    :param events: added to those of the game.
    :param tasks: besides driving, added to those of the game; a task replaces an outer one of the
        same name.
    :param labels: texts of tasks that the participant reads instead of their `label`, by the
        task's name: one text, or one for each language.
    """

    game: Annotated[str, Named(), Wording(r'[\s\S]+', 'name a game file')] | None = None
    scenario: Path | None = None
    seat: str | None = None
    seats: Annotated[tuple[str, ...], Listed(2, 4, 'vehicle')] | None = None
    confederate: str | None = None
    planner: Annotated[str, Named(), Wording(r'[\s\S]+', 'name a planner')] | None = None
    options: dict[str, object] | None = None
    perception: Annotated[str, Named()] | None = None
    traffic: Annotated[str, Named()] | None = None
    seed: Annotated[int, Within(0, 2**63 - 1)] | Literal['each'] | None = None
    duration: Annotated[float, Within(0.0, 86_400.0, above=True)] | None = None
    view: Literal['map', 'driver', 'chase'] | None = None
    map: bool | None = None  # noqa: A003
    plans: bool | None = None
    names: bool | None = None
    sound: bool | None = None
    photodiode: Literal['top-left', 'top-right', 'bottom-left', 'bottom-right'] | None = None
    instruments: InstrumentsSpec | None = None
    events: EventList = ()
    tasks: TaskList = ()
    labels: dict[str, object] | None = None

    def check(self) -> None:
        """Refuse labels that are no texts, and vehicles of several people."""
        if self.seat is not None and self.seats is not None:
            raise InputError('is given beside "seats"', 'seat', 'give one of them')
        for name, count in Counter((*(self.seats or (self.seat,)), self.confederate)).items():
            if name is not None and count > 1:
                raise InputError(f'names {name} twice', 'seats', 'give each person one vehicle')
        for name in self.labels or {}:
            self.label_of(name, '')

    def label_of(self, task: str, language: str) -> str:
        """Return the label of a task in a language."""
        return LocalText.from_value((self.labels or {})[task],
                                    f'labels: {task}').in_language(language)

    def over(self, outer: 'TrialSettings') -> 'TrialSettings':
        """Return the outer settings overridden by these; lists and labels of both count."""
        given = {item.name: value for item in fields(self) if item.name not in ('events', 'tasks')
                 and (value := getattr(self, item.name)) is not None}
        # Options belong to one planner; another planner does not inherit them.
        if 'planner' in given and 'options' not in given:
            given['options'] = None
        # One of them is instead of the other.
        given |= {other: None for one, other in (('seat', 'seats'), ('seats', 'seat'))
                  if one in given}
        if self.labels is not None:
            given['labels'] = {**(outer.labels or {}), **self.labels}
        return replace(outer, **given, events=(*outer.events, *self.events),
                       tasks=tasks_over(outer.tasks, self.tasks))


def tasks_over(outer: tuple[TaskSpec, ...], inner: tuple[TaskSpec, ...]) -> tuple[TaskSpec, ...]:
    """Return outer and inner tasks; an inner one replaces an outer one of the same name."""
    names = {task.name for task in inner}
    return (*(task for task in outer if task.name not in names), *inner)


NOTHING = TrialSettings()
# The default settings.
STANDARD = TrialSettings(perception='own', traffic='own', seed=0, view='driver', map=False,
                         plans=False, names=False, sound=True)


@dataclass(frozen=True)
class Level:
    """
    A level of a factor.

    :param name: in tables.
    :param settings: of its trials.
    """

    FORM: ClassVar[Form] = Form(rest='settings')

    name: Name
    settings: TrialSettings = NOTHING


@dataclass(frozen=True)
class Factor:
    """
    An experimental factor.

    :param name: of its column in tables.
    :param levels: its levels, in the order of the file.
    """

    name: ColumnName
    levels: Annotated[tuple[Level, ...], Listed(2, 50, 'level', 'name')]

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the levels."""
        return tuple(level.name for level in self.levels)


def drawn(settings: TrialSettings, drive: str) -> TrialSettings:
    """
    Return the settings with a seed drawn for this drive, if they ask for one.

    :param drive: its unique name in the study; equal names give equal seeds everywhere.
    """
    if settings.seed != 'each':
        return settings
    return replace(settings, seed=random.Random(drive).getrandbits(31))


def laid(*settings: TrialSettings) -> TrialSettings:
    """Return the default settings overridden by these, given from outermost to innermost."""
    whole = STANDARD
    for each in settings:
        whole = each.over(whole)
    return whole
