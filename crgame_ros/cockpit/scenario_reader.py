# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""The process that reads scenarios for the page: one job at a time, ended when it takes long."""

import asyncio
import json
import logging
import os
from pathlib import Path
import sys
from typing import Any

from crgame_ros.errors import CrgameError, InputError

# Kept apart: preview imports CommonRoad, which the server's process may not need.
_HEADER_BYTES = 9
MAX_QUEUED = 8
TIMEOUT_S = 60.0

_PACKAGES = Path(__file__).resolve().parents[2]
_log = logging.getLogger(__name__)


class ScenarioReader:
    """
    Runs jobs of `preview` in a process that is started when first needed.

    :param timeout_s: after which a job is given up and its process ended [s].
    """

    def __init__(self, timeout_s: float = TIMEOUT_S) -> None:
        self._timeout_s = timeout_s
        self._lock = asyncio.Lock()
        self._queued = 0
        self._process: asyncio.subprocess.Process | None = None

    async def run(self, job: str, **arguments: Any) -> bytes:
        """
        Run a job.

        :param job: check, preview or compose.
        :param arguments: its arguments, as JSON can hold them.
        :return: its result as JSON.
        :raises CrgameError: if it fails, takes too long, or too many wait.
        """
        if self._queued >= MAX_QUEUED:
            raise CrgameError('too many scenarios are being read; try again in a moment')
        self._queued += 1
        try:
            async with self._lock:
                return await self._run({'job': job, **arguments})
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
        # Else its pipes would be closed when the loop is already gone.
        if process.stdin is not None:
            process.stdin.close()

    async def _run(self, job: dict[str, Any]) -> bytes:
        done = False
        try:
            async with asyncio.timeout(self._timeout_s):
                ok, answer = await self._exchange(json.dumps(job).encode() + b'\n')
            done = True
        except TimeoutError as error:
            raise CrgameError(f'the scenario takes more than {self._timeout_s:g} s to read; '
                              'choose a smaller one') from error
        except (ConnectionError, asyncio.IncompleteReadError) as error:
            _log.error('the process that reads scenarios ended during %s', job['job'])
            raise CrgameError('the scenario cannot be read: it is too large') from error
        finally:
            if not done:
                await self.close()
        if not ok:
            raise InputError(answer.decode('utf-8', 'replace'))
        return answer

    async def _exchange(self, line: bytes) -> tuple[bool, bytes]:
        process = self._process
        if process is None or process.returncode is not None:
            # The very package that asks, and nothing from the working directory.
            paths = [str(_PACKAGES), *filter(None, [os.environ.get('PYTHONPATH')])]
            process = self._process = await asyncio.create_subprocess_exec(
                sys.executable, '-P', '-m', 'crgame_ros.cockpit.preview',
                stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
                env={**os.environ, 'PYTHONPATH': os.pathsep.join(paths)})
        assert process.stdin is not None and process.stdout is not None
        process.stdin.write(line)
        await process.stdin.drain()
        header = await process.stdout.readexactly(_HEADER_BYTES)
        answer = await process.stdout.readexactly(int.from_bytes(header[1:], 'little'))
        return header[0] == 1, answer
