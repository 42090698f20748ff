# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tasks of a game, which drivers answer or do besides driving."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from crgame_ros.errors import InputError
from crgame_ros.game.events import AtStep, AtTime, Between, EntryName, Near
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Advice, Keyed, LeftOut, Listed, Parts, Within, Wording

MAX_TASKS = 20
TaskKind = Literal['detection_response', 'take_over', 'secondary_task']
# The key of an answer, and that of a request whose driver answers lights as well.
ANSWER_KEY, SECOND_KEY = 'Enter', 'KeyT'
# W, A, S, D, R, J and G drive.
Key = Annotated[str, Wording('Enter|Key[BCEFHIK-QT-VX-Z]|Digit[0-9]|Numpad([0-9]|Enter)',
                             'name a key that does not drive: Enter, KeyT, Digit1, Numpad0')]
Button = Annotated[int, Within(0, 99)]


@dataclass(frozen=True)
class DetectionResponse:
    """
    The visual detection response task (ISO 17488): the driver answers a red light by a button.

    Each light is a stimulus. The first answer to it counts.

    :param interval: shortest and longest time from one onset to the next, drawn uniformly [s]
    :param shown: the light goes out with its answer, at the latest after this time [s]
    :param earliest: an answer earlier than this time after the onset is premature [s]
    :param latest: an answer later than this time after the onset does not count, and the stimulus
        is missed [s]
    :param key: that answers it, by its place on the keyboard.
    :param button: of a gamepad or wheel that answers it, from 0; by default any that has no other
        meaning, and the first such one if its driver may be asked to take over, too.
    """

    interval: Annotated[tuple[float, float], Parts(('shortest', 'longest')), Within(0.5, 600.0),
                        Advice('give two times')] = (3.0, 5.0)
    shown: Annotated[float, Within(0.05, 60.0)] = 1.0
    earliest: Annotated[float, Within(0.0, 10.0)] = 0.1
    latest: Annotated[float, Within(0.1, 60.0)] = 2.5
    key: Key = ANSWER_KEY
    button: Button | None = None

    def check(self) -> None:
        """Refuse overlapping stimuli, and times in the wrong order."""
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
    A visible and audible request to take over.

    :param lead: time from the request to its event [s]
    :param before: name of the event that the request announces. The request comes `lead` before
        the time of that event; an event without a time is triggered `lead` after the request.
    :param shown: time after the lead at which the request disappears, if no driver takes over
        before [s]
    :param key: that takes over; by default Enter, and T if its driver answers lights as well.
    :param button: of a gamepad or wheel that takes over, from 0; by default any that has no other
        meaning.
    """

    lead: Annotated[float, Within(0.0, 600.0)] = 5.0
    before: str | None = None
    shown: Annotated[float, Within(0.0, 600.0)] = 5.0
    key: Key | None = None
    button: Button | None = None


@dataclass(frozen=True)
class SecondaryTask:
    """
    A period in which the driver does another task.

    :param show: whether the label is shown to the driver during the task.
    """

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
    One task of a game. Its button also begins it, and ends it if it has a duration.

    :param name: its name in tables.
    :param task: the kind of task, with its parameters.
    :param label: text of a take-over request or a secondary task for the driver; by default words
        in the language of the page, or the name.
    :param seat: the vehicle whose driver it is for; the first human's by default.
    :param when: condition under which it begins by itself; None leaves it to the button, and a
        take-over request to the time of its event.
    :param until: condition under which it ends by itself; None leaves it to the button and to the
        end of the run.
    """

    FORM: ClassVar[Form] = Form('see docs/games.md for the keys', first=('name', 'label'))

    name: EntryName
    task: Annotated[Task, Keyed(dict(TASKS), 'task')]
    label: Annotated[str, LeftOut(),
                     Wording(r'[\s\S]{0,80}', 'give a text of 80 characters at most')] = ''
    seat: Annotated[str | None, LeftOut()] = None
    when: Annotated[TaskCondition | None, LeftOut()] = None
    until: Annotated[TaskCondition | None, LeftOut()] = None

    def check(self) -> None:
        """Refuse an end of a task without duration."""
        if isinstance(self.task, TakeOverPrompt) and self.until is not None:
            raise InputError('a take-over request has "until"', '', 'give it "shown"')

    @property
    def kind(self) -> TaskKind:
        """Return the key of the kind of task."""
        return next(key for key, kind in TASKS.items() if type(self.task) is kind)


TaskList = Annotated[tuple[TaskSpec, ...], Listed(0, MAX_TASKS, 'task', 'name')]


def answer_key(spec: TaskSpec, tasks: Sequence[TaskSpec]) -> str | None:
    """
    Return the key that answers a task; None for a task without an answer.

    :param tasks: of the game, each with its seat.
    """
    task = spec.task
    if isinstance(task, TakeOverPrompt):
        lights = any(isinstance(each.task, DetectionResponse) and each.seat == spec.seat
                     for each in tasks)
        return task.key or (SECOND_KEY if lights else ANSWER_KEY)
    return task.key if isinstance(task, DetectionResponse) else None
