# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The messages about tasks between the simulation and pages: log, state and reports."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
import json
from typing import Annotated, Literal

from annotated_types import Interval, Len
from crgame_ros.game.driven_vehicle import VehicleId
from crgame_ros.game.task_spec import TaskKind
from crgame_ros.schema.bounded import Bounded, Exact
from crgame_ros.schema.json_documents import DocumentReader

LOG_TOPIC = '/tasks/log'
STATE_TOPIC = '/tasks/state'
REPORT_TOPIC = '/tasks/report'
MAX_NUMBER = 1_000_000
# Longest time in a page's report [ms].
LONGEST_MS = 600_000.0
PromptNumber = Annotated[int, Exact(), Interval(ge=0, le=MAX_NUMBER)]
Milliseconds = Annotated[float, Exact(), Interval(ge=-LONGEST_MS, le=LONGEST_MS)]

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
    """

    response_ms: Milliseconds | None = None
    delay_ms: Milliseconds | None = None
    picture_ms: Milliseconds | None = None
    paused_ms: Milliseconds | None = None


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
class _Log:
    epoch: int
    entries: Annotated[tuple[TaskEntry, ...], Bounded(10_000)]


@dataclass(frozen=True)
class TaskState:
    """
    The content of `/tasks/state`.

    :param epoch: of the run.
    :param running: names of the running tasks.
    :param open: what is neither answered nor over.
    """

    epoch: int
    running: Annotated[tuple[str, ...], Bounded(10_000)]
    open: Annotated[tuple[OpenPrompt, ...], Bounded(10_000)]  # noqa: A003


_LOG: DocumentReader[_Log] = DocumentReader(_Log, LOG_TOPIC, 'log of tasks')
_STATE: DocumentReader[TaskState] = DocumentReader(TaskState, STATE_TOPIC, 'state of tasks')
_REPORT: DocumentReader[TaskReport] = DocumentReader(TaskReport, REPORT_TOPIC, 'report of a page')


def log_document(epoch: int, entries: Sequence[TaskEntry]) -> str:
    """Return the text of `/tasks/log`: the entries of one step."""
    return json.dumps(asdict(_Log(epoch, tuple(entries))))


def parse_log(text: str) -> tuple[int, tuple[TaskEntry, ...]]:
    """
    Read `/tasks/log`.

    :return: the epoch, and the entries, in order.
    :raises InputError: if it is not what `log_document` writes.
    """
    found = _LOG.read(text)
    return found.epoch, found.entries


def state_document(state: TaskState) -> str:
    """Return the text of `/tasks/state`."""
    return json.dumps(asdict(state))


def parse_state(text: str) -> TaskState:
    """
    Read `/tasks/state`.

    :raises InputError: if it is not what `state_document` writes.
    """
    return _STATE.read(text)


def report_text(report: TaskReport) -> str:
    """Return the text of `/tasks/report`."""
    return json.dumps(asdict(report))


def parse_report(text: str) -> TaskReport:
    """
    Read `/tasks/report`.

    :raises InputError: if it is not what `report_text` writes.
    """
    return _REPORT.read(text)
