# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The messages about tasks between the simulation and pages: log, state and reports."""

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval, Len
from crgame_ros.game.documents import VehicleId
from crgame_ros.game.task_spec import TaskKind
from crgame_ros.schema.document_marks import Bounded, Exact
from crgame_ros.schema.json_documents import JsonDocument

MAX_NUMBER = 1_000_000
# Longest time in a page's report [ms].
LONGEST_MS = 600_000.0
PromptNumber = Annotated[int, Exact(), Interval(ge=0, le=MAX_NUMBER)]
Milliseconds = Annotated[float, Exact(), Interval(ge=-LONGEST_MS, le=LONGEST_MS)]
SteadySeconds = Annotated[float, Exact(), Interval(ge=0.0, le=1e10)]

# Kinds of task entries: the task begins or ends; a stimulus or request comes, is shown, or is
# over; the driver answers (`unrequested` answers had no stimulus).
TaskHappening = Literal['begin', 'end', 'stimulus', 'request', 'shown', 'answer', 'unrequested',
                        'missed', 'over']


@dataclass(frozen=True)
class PageTimes:
    """
    The times that a page has measured by its own clock [ms].

    :param response_ms: from the first video frame with the stimulus to the answer, without pauses
        of the run; None without an answer.
    :param delay_ms: from the stimulus's onset to that frame, by the page's estimate.
    :param picture_ms: from that frame to the next: the uncertainty of the first.
    :param paused_ms: pauses between frame and answer, which the response time leaves out.
    :param steady_s: when that frame was drawn, on the steady clock of the server's machine, which
        is that of the run's cycles [s]; None if no ping has related the clocks.
    :param clock_error_ms: half of the round trip that related both clocks: the error of `steady_s`
        is no larger.
    """

    response_ms: Milliseconds | None = None
    delay_ms: Milliseconds | None = None
    picture_ms: Milliseconds | None = None
    paused_ms: Milliseconds | None = None
    steady_s: SteadySeconds | None = None
    clock_error_ms: Milliseconds | None = None


NOT_MEASURED = PageTimes()


@dataclass(frozen=True)
class TaskEntry:
    """
    An entry in the log of a task.

    :param n: simulation step.
    :param task: its name.
    :param kind: of task.
    :param seat: the vehicle whose driver it is for.
    :param what: kind of entry.
    :param number: of the stimulus or request, from 1; 0 for entries without one.
    :param by: what made the task begin or end (condition, trigger), a request end (driven, time),
        what an answer is (hit, premature), or why a stimulus was missed (unseen).
    :param times: as the page has measured them.
    """

    n: int
    task: str
    kind: TaskKind
    seat: VehicleId
    what: TaskHappening
    number: PromptNumber = 0
    by: str = ''
    times: PageTimes = NOT_MEASURED


@dataclass(frozen=True)
class OpenPrompt:
    """
    A stimulus or request that is neither answered nor over.

    :param task: its name.
    :param seat: the vehicle whose driver it is for.
    :param number: of it, from 1.
    :param n: simulation step of its onset.
    :param seen: whether a page has shown it.
    """

    task: str
    seat: VehicleId
    number: PromptNumber
    n: int
    seen: bool = False


@dataclass(frozen=True)
class TaskReport:
    """
    A page's report that it has shown a stimulus or request, or that its driver answered.

    :param seat: the vehicle whose driver it is.
    :param task: name of the task.
    :param number: of the stimulus or request; 0 for an answer without one.
    :param what: `shown` or `answer`.
    :param times: as the page has measured them.
    """

    seat: VehicleId
    task: Annotated[str, Len(0, 40)]
    number: PromptNumber
    what: Literal['shown', 'answer']
    times: PageTimes = NOT_MEASURED


@dataclass(frozen=True)
class TaskLog:
    """
    What is new in the tasks of a run.

    :param epoch: of the run.
    :param entries: of one step, in order.
    """

    epoch: int
    entries: Annotated[tuple[TaskEntry, ...], Bounded(10_000)]


@dataclass(frozen=True)
class TaskState:
    """
    The running tasks and open prompts of a run.

    :param epoch: of the run.
    :param running: names of the running tasks.
    :param open: what is neither answered nor over.
    """

    epoch: int
    running: Annotated[tuple[str, ...], Bounded(10_000)]
    open: Annotated[tuple[OpenPrompt, ...], Bounded(10_000)]  # noqa: A003


TASK_LOG: JsonDocument[TaskLog] = JsonDocument(TaskLog, '/tasks/log', 'log of tasks')
TASK_STATE: JsonDocument[TaskState] = JsonDocument(TaskState, '/tasks/state', 'state of tasks')
TASK_REPORT: JsonDocument[TaskReport] = JsonDocument(
    TaskReport, '/tasks/report', 'report of a page')
