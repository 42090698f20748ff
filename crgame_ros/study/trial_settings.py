# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a trial is like: settings that cascade from the study to its blocks, levels and trials."""

from dataclasses import dataclass, fields, replace
from pathlib import Path
import random
from typing import Annotated, Any, ClassVar, Literal

from crgame_ros.game.events import EventList
from crgame_ros.game.task_spec import TaskList, TaskSpec
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Listed, Named, Within, Wording
from crgame_ros.study.names import ColumnName, Name

_SEE = 'see docs/studies.md for the keys'


@dataclass(frozen=True)
class TrialSettings:
    """
    Settings of trials; what is left out stays as it is further out.

    :param game: game file.
    :param scenario: CommonRoad file instead of the game's; without a game anybody drives near its
        first AV.
    :param seat: the vehicle in which the participant sits; the game's first human by default. An
        AV drives itself until the participant takes it over.
    :param planner: of all AVs, instead of the game's.
    :param options: of that planner.
    :param perception: file with the `perception` of all AVs, `perfect`, or `own` for the game's.
    :param traffic: file with the `traffic`, `none`, or `own` for the game's.
    :param seed: of everything random; `each` draws another one for each drive of each participant.
    :param duration: longest simulated time [s]
    :param view: what the participant sees at the start.
    :param map: whether the map is there, beside the view.
    :param plans: whether AVs' plans and what they perceive may be shown.
    :param names: whether the names of planners are shown.
    :param sound: whether there is sound.
    :param events: added to those of the game.
    :param tasks: besides driving, added to those of the game; one of the same name replaces that
        further out.
    """

    FORM: ClassVar[Form] = Form(_SEE)

    game: Annotated[str, Named(), Wording(r'[\s\S]+', 'name a game file')] | None = None
    scenario: Path | None = None
    seat: str | None = None
    planner: Annotated[str, Named(), Wording(r'[\s\S]+', 'name a planner')] | None = None
    options: dict[str, Any] | None = None
    perception: Annotated[str, Named()] | None = None
    traffic: Annotated[str, Named()] | None = None
    seed: Annotated[int, Within(0, 2**63 - 1)] | Literal['each'] | None = None
    duration: Annotated[float, Within(0.0, 86_400.0, above=True)] | None = None
    view: Literal['map', 'driver', 'chase'] | None = None
    map: bool | None = None  # noqa: A003
    plans: bool | None = None
    names: bool | None = None
    sound: bool | None = None
    events: EventList = ()
    tasks: TaskList = ()

    def over(self, outer: 'TrialSettings') -> 'TrialSettings':
        """Lay these over settings further out; events and tasks of both count."""
        given = {item.name: value for item in fields(self) if item.name not in ('events', 'tasks')
                 and (value := getattr(self, item.name)) is not None}
        # Options are those of a planner: another one does not take them.
        if 'planner' in given and 'options' not in given:
            given['options'] = None
        return replace(outer, **given, events=(*outer.events, *self.events),
                       tasks=tasks_over(outer.tasks, self.tasks))


def tasks_over(outer: tuple[TaskSpec, ...], inner: tuple[TaskSpec, ...]) -> tuple[TaskSpec, ...]:
    """Lay tasks over those further out: one of the same name takes the place of the other."""
    names = {task.name for task in inner}
    return (*(task for task in outer if task.name not in names), *inner)


NOTHING = TrialSettings()
EACH = 'each'
# What holds where nobody says otherwise.
STANDARD = TrialSettings(perception='own', traffic='own', seed=0, view='driver', map=False,
                         plans=False, names=False, sound=True)


@dataclass(frozen=True)
class Level:
    """
    One of the conditions that a factor has.

    :param name: in tables.
    :param settings: what is so in it.
    """

    FORM: ClassVar[Form] = Form(_SEE, rest='settings')

    name: Name
    settings: TrialSettings = NOTHING


@dataclass(frozen=True)
class Factor:
    """
    Something that differs between conditions.

    :param name: of its column in tables.
    :param levels: of it, in the order of the file.
    """

    FORM: ClassVar[Form] = Form(_SEE)

    name: ColumnName
    levels: Annotated[tuple[Level, ...], Listed(2, 50, 'level', 'name')]


def drawn(settings: TrialSettings, drive: str) -> TrialSettings:
    """
    Draw the seed of a drive that is to have one of its own.

    :param drive: names it among all of the study; the same name gives the same seed everywhere.
    """
    if settings.seed != EACH:
        return settings
    return replace(settings, seed=random.Random(drive).getrandbits(31))


def laid(*settings: TrialSettings) -> TrialSettings:
    """Lay settings over each other, the outermost first, over what is standard."""
    whole = STANDARD
    for each in settings:
        whole = each.over(whole)
    return whole
