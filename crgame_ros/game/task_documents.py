# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The messages about tasks between the simulation and pages: log, state and reports."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
import json
import math
from typing import Any, get_args, Literal

from crgame_ros.errors import InputError
from crgame_ros.game.documents import MALFORMED
from crgame_ros.game.driven_vehicle import VEHICLE_ID
from crgame_ros.game.task_spec import TaskKind, TASKS

LOG_TOPIC = '/tasks/log'
STATE_TOPIC = '/tasks/state'
REPORT_TOPIC = '/tasks/report'
MAX_NUMBER = 1_000_000
# Longest time in a page's report [ms].
LONGEST_MS = 600_000.0

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

    response_ms: float | None = None
    delay_ms: float | None = None
    picture_ms: float | None = None
    paused_ms: float | None = None


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
    seat: str
    what: TaskHappening
    number: int = 0
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
    seat: str
    number: int
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

    seat: str
    task: str
    number: int
    what: Literal['shown', 'answer']
    times: PageTimes = NOT_MEASURED


def log_document(epoch: int, entries: Sequence[TaskEntry]) -> str:
    """Return the text of `/tasks/log`: the entries of one step."""
    return json.dumps({'epoch': epoch, 'entries': [asdict(entry) for entry in entries]})


def parse_log(text: str) -> tuple[int, tuple[TaskEntry, ...]]:
    """
    Read `/tasks/log`.

    :return: the epoch, and the entries, in order.
    :raises InputError: if it is not what `log_document` writes.
    """
    try:
        content = json.loads(text)
        return int(content['epoch']), tuple(_entry(each) for each in content['entries'])
    except MALFORMED as error:
        raise InputError(f'is no log of tasks ({type(error).__name__}: {error})',
                         LOG_TOPIC) from error


def state_document(epoch: int, running: Sequence[str], prompts: Sequence[OpenPrompt]) -> str:
    """Return the text of `/tasks/state`: the running tasks and the open prompts."""
    return json.dumps({'epoch': epoch, 'running': list(running),
                       'open': [asdict(prompt) for prompt in prompts]})


def parse_state(text: str) -> tuple[int, dict[str, Any]]:
    """
    Read `/tasks/state`.

    :return: the epoch, and `running` and `open` for the pages.
    :raises InputError: if it is not what `state_document` writes.
    """
    try:
        content = json.loads(text)
        return int(content['epoch']), {
            'running': [str(name) for name in content['running']],
            'open': [asdict(OpenPrompt(
                str(each['task']), _seat(each['seat']), _number(each['number']), int(each['n']),
                bool(each['seen']))) for each in content['open']]}
    except MALFORMED as error:
        raise InputError('is not what the contract says', STATE_TOPIC) from error


def report_text(report: TaskReport) -> str:
    """Return the text of `/tasks/report`."""
    return json.dumps(asdict(report))


def parse_report(text: str) -> TaskReport:
    """
    Read `/tasks/report`.

    :raises InputError: if it is not what `report_text` writes.
    """
    try:
        content = json.loads(text)
        if content['what'] not in ('shown', 'answer'):
            raise ValueError('neither shown nor answer')
        return TaskReport(_seat(content['seat']), str(content['task'])[:40],
                          _number(content['number']), content['what'], _times(content['times']))
    except MALFORMED as error:
        raise InputError('is not what the contract says', REPORT_TOPIC) from error


def _entry(content: Any) -> TaskEntry:
    if content['kind'] not in TASKS or content['what'] not in get_args(TaskHappening):
        raise ValueError('no such kind of entry')
    return TaskEntry(int(content['n']), str(content['task']), content['kind'],
                     _seat(content['seat']), content['what'], _number(content['number']),
                     str(content['by']), _times(content['times']))


def _seat(value: Any) -> str:
    if not isinstance(value, str) or VEHICLE_ID.fullmatch(value) is None:
        raise ValueError('no vehicle')
    return value


def _number(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= MAX_NUMBER:
        raise ValueError('no number')
    return value


def _times(content: Any) -> PageTimes:
    return PageTimes(**{name: _milliseconds(content[name]) for name in PageTimes.__annotations__})


def _milliseconds(value: Any) -> float | None:
    if value is None:
        return None
    if isinstance(value, bool) or not math.isfinite(value) or abs(value) > LONGEST_MS:
        raise ValueError('no time')
    return float(value)
