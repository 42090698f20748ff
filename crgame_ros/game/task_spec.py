# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tasks of a game: what somebody is asked to answer or to do besides driving."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from crgame_ros.errors import InputError
from crgame_ros.game.events import AtStep, AtTime, Between, Near
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Advice, Keyed, LeftOut, Listed, Parts, Within, Wording

MAX_TASKS = 20
_SEE = 'see docs/games.md for the keys'
TaskKind = Literal['detection_response', 'take_over', 'secondary_task']


@dataclass(frozen=True)
class DetectionResponse:
    """
    The visual detection response task (ISO 17488): a red light, to be answered by a button.

    Each light is a stimulus. The first answer to it counts.

    :param interval: shortest and longest time from one onset to the next, of which every one is
        equally likely [s]
    :param shown: the light goes out with its answer, at the latest after this time [s]
    :param earliest: an earlier answer is premature, seconds after the onset [s]
    :param latest: a later answer answers nothing, and the stimulus is missed [s]
    """

    FORM: ClassVar[Form] = Form(_SEE)

    interval: Annotated[tuple[float, float], Parts(('shortest', 'longest')), Within(0.5, 600.0),
                        Advice('give two times')] = (3.0, 5.0)
    shown: Annotated[float, Within(0.05, 60.0)] = 1.0
    earliest: Annotated[float, Within(0.0, 10.0)] = 0.1
    latest: Annotated[float, Within(0.1, 60.0)] = 2.5

    def check(self) -> None:
        """Refuse two stimuli at one time, and times that are crossed."""
        shortest, longest = self.interval
        if shortest > longest:
            raise InputError('"interval" has its longest time first')
        if self.earliest >= self.latest:
            raise InputError('"earliest" is not before "latest"')
        if max(self.latest, self.shown) > shortest:
            raise InputError('the next stimulus would come within "shown" or "latest"', '',
                             f'let "interval" begin at {max(self.latest, self.shown):g} s or more')


@dataclass(frozen=True)
class TakeOverPrompt:
    """
    A request to take over, seen and heard.

    :param lead: time from the request to what it is about [s]
    :param before: name of the event that it is about. The request comes so long before the time
        of that event; an event without a time is triggered so long after the request.
    :param shown: so long after the lead the request disappears, unless somebody drives the
        vehicle before [s]
    """

    FORM: ClassVar[Form] = Form(_SEE)

    lead: Annotated[float, Within(0.0, 600.0)] = 5.0
    before: str | None = None
    shown: Annotated[float, Within(0.0, 600.0)] = 5.0


@dataclass(frozen=True)
class SecondaryTask:
    """
    A stretch in which the driver does something else.

    :param show: whether the driver reads the label while it lasts.
    """

    FORM: ClassVar[Form] = Form(_SEE)

    show: bool = False


@dataclass(frozen=True)
class OnEvent:
    """
    As soon as an event of the game has taken effect.

    :param event: its name.
    """

    event: str


Task = DetectionResponse | TakeOverPrompt | SecondaryTask
TaskCondition = AtTime | AtStep | Near | Between | OnEvent

TASKS: dict[TaskKind, type[Task]] = {
    'detection_response': DetectionResponse, 'take_over': TakeOverPrompt,
    'secondary_task': SecondaryTask}


@dataclass(frozen=True)
class TaskSpec:
    """
    One task of a game. Its button begins it too, and ends what lasts.

    :param name: by which it is known in tables.
    :param task: what is to be done.
    :param label: what the driver reads, of a take-over request and a secondary task; without it
        words in the language of the page, or the name.
    :param seat: the vehicle whose driver it is for; the first human's by default.
    :param when: condition under which it begins by itself; None leaves it to the button, and a
        take-over request to the time of its event.
    :param until: condition under which it ends by itself; None leaves it to the button and to the
        end of the run.
    """

    FORM: ClassVar[Form] = Form(_SEE, first=('name', 'label'))

    name: Annotated[str, Wording('[a-z0-9_-]{1,40}',
                                 'give 1 to 40 of the characters a-z, 0-9, _ and -')]
    task: Annotated[Task, Keyed(dict(TASKS), 'task')]
    label: Annotated[str, LeftOut(),
                     Wording(r'[\s\S]{0,80}', 'give a text of 80 characters at most')] = ''
    seat: Annotated[str | None, LeftOut()] = None
    when: Annotated[TaskCondition | None, LeftOut()] = None
    until: Annotated[TaskCondition | None, LeftOut()] = None

    def check(self) -> None:
        """Refuse an end of what has no length."""
        if isinstance(self.task, TakeOverPrompt) and self.until is not None:
            raise InputError('a take-over request has "until"', '', 'give it "shown"')

    @property
    def kind(self) -> TaskKind:
        """Key of what is to be done."""
        return next(key for key, kind in TASKS.items() if type(self.task) is kind)


TaskList = Annotated[tuple[TaskSpec, ...], Listed(0, MAX_TASKS, 'task', 'name')]
