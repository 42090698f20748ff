# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A process that reads files for the page, one job at a time, with a time limit for each.

Reading can take seconds and much memory. The process that serves the page, and may carry a
driver's inputs, can afford neither. Jobs are JSON objects, one a line, with the name of the
`job`, a `path` if it reads a file, and further arguments; each is answered on the standard
output, with one of `JobOutcome`.
"""

import asyncio
from collections.abc import Callable, Mapping
import contextlib
from enum import IntEnum
import json
import logging
import os
from pathlib import Path
import resource
import signal
import struct
import sys
import traceback
from types import FrameType
from typing import Any, BinaryIO

from crgame_ros.errors import CrgameError, InputError

MAX_QUEUED = 8
TIMEOUT_S = 60.0
# Interval at which it is checked whether the client still waits [s].
LOOK_S = 0.25

_PACKAGES = Path(__file__).resolve().parents[2]
_log = logging.getLogger(__name__)
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


class JobProcess:
    """
    A process with a module that answers jobs (`serve_jobs`), started at its first job.

    :param module: dotted name of the module.
    :param subject: readable name of what its jobs read: scenario or run.
    :param timeout_s: time after which a job is aborted and the process ended [s].
    """

    def __init__(self, module: str, subject: str, timeout_s: float = TIMEOUT_S) -> None:
        self._module = module
        self._subject = subject
        self._timeout_s = timeout_s
        self._lock = asyncio.Lock()
        self._queued = 0
        self._process: asyncio.subprocess.Process | None = None

    async def start(self) -> None:
        """Start the process early, so that its first job need not wait for its imports."""
        async with self._lock:
            await self._running()

    async def run(self, job: str, *, unwanted: Callable[[], bool] = lambda: False,
                  **arguments: object) -> bytes:
        """
        Run a job.

        :param unwanted: returns True once no client waits for the result; the job is then ended.
        :param arguments: its arguments, as JSON content.
        :return: its result as JSON.
        :raises CrgameError: if it fails, takes too long, is unwanted, or too many wait.
        """
        if self._queued >= MAX_QUEUED:
            raise CrgameError(f'too many {self._subject}s are being read; try again in a moment')
        self._queued += 1
        try:
            async with self._lock:
                return await self._run({'job': job, **arguments}, unwanted)
        finally:
            self._queued -= 1

    async def close(self) -> None:
        """End the process."""
        process = self._process
        if process is not None:
            await end_module(process)
            # Kept until then: whoever ends the server waits for it too if this job is cancelled.
            if self._process is process:
                self._process = None

    async def _run(self, job: dict[str, object], unwanted: Callable[[], bool]) -> bytes:
        done = False
        try:
            async with asyncio.timeout(self._timeout_s):
                outcome, answer = await self._wanted(job, unwanted)
            # An aborted job leaves half a gigabyte of memory behind.
            done = outcome is not JobOutcome.GIVEN_UP
        except TimeoutError as error:
            raise CrgameError(f'the {self._subject} takes more than {self._timeout_s:g} s to '
                              'read; choose a smaller one') from error
        except (ConnectionError, asyncio.IncompleteReadError) as error:
            _log.error('the process that reads %ss ended during %s', self._subject, job['job'])
            raise CrgameError(f'the {self._subject} cannot be read: it is too large') from error
        finally:
            if not done:
                await self.close()
        if outcome is not JobOutcome.DONE:
            raise InputError(answer.decode('utf-8', 'replace'))
        return answer

    async def _wanted(self, job: dict[str, object],
                      unwanted: Callable[[], bool]) -> tuple[JobOutcome, bytes]:
        """Return the answer of a job, as long as a client waits for it."""
        exchange = asyncio.create_task(self._exchange(json.dumps(job).encode() + b'\n'))
        try:
            while not (await asyncio.wait([exchange], timeout=LOOK_S))[0]:
                if unwanted():
                    raise CrgameError('its client has gone')
            return exchange.result()
        finally:
            exchange.cancel()

    async def _exchange(self, line: bytes) -> tuple[JobOutcome, bytes]:
        process = await self._running()
        assert process.stdin is not None and process.stdout is not None
        process.stdin.write(line)
        await process.stdin.drain()
        outcome, size = HEADER.unpack(await process.stdout.readexactly(HEADER.size))
        return JobOutcome(outcome), await process.stdout.readexactly(size)

    async def _running(self) -> asyncio.subprocess.Process:
        process = self._process
        if process is None or process.returncode is not None:
            process = self._process = await start_module(self._module)
        return process


async def start_module(module: str, *arguments: str,
                       own_session: bool = False) -> asyncio.subprocess.Process:
    """
    Start a module of this package in a process of its own, with pipes.

    :param own_session: whether Ctrl-C does not reach it.
    """
    # Use the package of this process, and nothing from the working directory.
    paths = [str(_PACKAGES), *filter(None, [os.environ.get('PYTHONPATH')])]
    return await asyncio.create_subprocess_exec(
        sys.executable, '-P', '-m', module, *arguments, stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE, env={**os.environ, 'PYTHONPATH': os.pathsep.join(paths)},
        start_new_session=own_session)


async def end_module(process: asyncio.subprocess.Process) -> None:
    """End a process that `start_module` has started, if it has not ended yet."""
    if process.returncode is None:
        process.kill()
    await process.wait()
    # Else its pipes would be closed after the event loop.
    if process.stdin is not None:
        process.stdin.close()
