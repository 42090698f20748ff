# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The worker process of `job_process`, which answers jobs until its standard input ends.

Reading can take seconds and much memory. The process that serves the page, and may carry a
driver's inputs, can afford neither. Jobs are JSON objects, one a line, with the name of the
`job`, a `path` if it reads a file, and further arguments; each is answered on the standard
output, with one of `JobOutcome`.
"""

from collections.abc import Callable, Mapping
import contextlib
from enum import IntEnum
import json
import os
from pathlib import Path
import resource
import signal
import struct
import sys
import traceback
from types import FrameType
from typing import Any, BinaryIO

from crgame_ros.errors import CrgameError

HEADER = struct.Struct('<BQ')
_MAX_MEMORY = 4 * 2 ** 30
_NICE = 10
# Processor time that one job may take [s]. The preview of a map of 50,000 lanelets, the most
# that the guard allows, would take 33 s and 1.4 GB (docs/measurements.md).
MOST_CPU_S = 20.0

Job = Callable[..., dict[str, object]]


class JobOutcome(IntEnum):
    """The outcome of a job; after an aborted job the process has to end."""

    REFUSED = 0
    DONE = 1
    GIVEN_UP = 2


class _GivenUpError(CrgameError):
    """Error of a job that has exceeded its processor time."""


def serve_jobs(jobs: Mapping[str, Job], subject: str, most_cpu_s: float = MOST_CPU_S) -> None:
    """
    Answer jobs until the standard input ends.

    :param jobs: functions by name; each gets the path, if there is one, and the other arguments as
        keywords, and returns JSON content.
    :param subject: readable name of what they read.
    :param most_cpu_s: processor time after which a job is aborted [s].
    """
    def stop_job(_number: int, _frame: FrameType | None) -> None:
        raise _GivenUpError(f'the {subject} takes more than {most_cpu_s:g} s to read; choose a '
                            'smaller one')

    signal.signal(signal.SIGPROF, stop_job)
    # Ctrl-C goes to the server, which closes the standard input when it ends.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(_NICE)
    resource.setrlimit(resource.RLIMIT_AS, (_MAX_MEMORY, _MAX_MEMORY))
    answers = os.fdopen(os.dup(1), 'wb')
    # The output of a library must not get into the answers.
    os.dup2(2, 1)
    with contextlib.suppress(BrokenPipeError):
        for line in sys.stdin.buffer:
            _answer(jobs, json.loads(line), answers, subject, most_cpu_s)


def _answer(jobs: Mapping[str, Job], job: dict[str, Any], answers: BinaryIO,
            subject: str, most_cpu_s: float) -> None:
    path = Path(job.pop('path')) if 'path' in job else None
    try:
        signal.setitimer(signal.ITIMER_PROF, most_cpu_s)
        try:
            result = jobs[job.pop('job')](*([path] if path else []), **job)
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
        outcome, text = JobOutcome.DONE, json.dumps(result, allow_nan=False, separators=(',', ':'))
    except CrgameError as error:
        # An answer must not reveal the folders of this machine.
        outcome = JobOutcome.GIVEN_UP if isinstance(error, _GivenUpError) else JobOutcome.REFUSED
        text = str(error)
        if path is not None:
            text = text.replace(f'{path}', path.name).replace(f'{path.parent}/', '')
    except (MemoryError, RecursionError):
        outcome, text = JobOutcome.GIVEN_UP, f'the {subject} is too large to be read'
    except Exception:
        traceback.print_exc()
        outcome = JobOutcome.REFUSED
        text = f'the {subject} cannot be read; the log of the server says why'
    data = text.encode('utf-8', 'replace')
    answers.write(HEADER.pack(outcome, len(data)) + data)
    answers.flush()
