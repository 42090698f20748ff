# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A process that reads files for the page, one job at a time, with a time limit for each."""

import asyncio
from collections.abc import Callable
import json
import logging
import os
from pathlib import Path
import sys

from crgame_ros.cockpit.job_loop import HEADER, JobOutcome
from crgame_ros.errors import CrgameError, InputError

MAX_QUEUED = 8
TIMEOUT_S = 60.0
# Interval at which it is checked whether the client still waits [s].
LOOK_S = 0.25

_PACKAGES = Path(__file__).resolve().parents[2]
_log = logging.getLogger(__name__)


class JobProcess:
    """
    A process with a module that answers jobs (`job_loop`), started at its first job.

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

        :param job: its name.
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
        process, self._process = self._process, None
        if process is None:
            return
        if process.returncode is None:
            process.kill()
        await process.wait()
        # Else its pipes would be closed after the event loop.
        if process.stdin is not None:
            process.stdin.close()

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
            # Use the package of this process, and nothing from the working directory.
            paths = [str(_PACKAGES), *filter(None, [os.environ.get('PYTHONPATH')])]
            process = self._process = await asyncio.create_subprocess_exec(
                sys.executable, '-P', '-m', self._module,
                stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
                env={**os.environ, 'PYTHONPATH': os.pathsep.join(paths)})
        return process
