# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The graph in which participants drive, as a child process with its own DDS domain."""

from collections.abc import Sequence
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from crgame_ros.ros.environment import free_domain_id

_AT, _DIRECT = 'the cockpit is at ', '  to direct '
# Time limit for finishing recordings [s].
_END_S = 90.0


class StudyGraph:
    """
    A launcher with its nodes.

    :param game: its first game file; later ones may come from the same folder.
    :param folder: of its runs; created if missing.
    :param port: of its cockpit; the next free one if it is in use.
    :param more: further arguments of the launcher.
    :ivar domain_id: its `ROS_DOMAIN_ID`.
    :ivar cockpit: address of its cockpit; empty before it is known.
    :ivar director: link to direct it, if it is opened to other machines; else empty.
    """

    def __init__(self, game: Path, folder: Path, port: int, more: Sequence[str] = ()) -> None:
        self.folder = folder
        self.domain_id = free_domain_id()
        self._log = folder.with_suffix('.log')
        self._read = 0
        self._rest = b''
        self.cockpit = self.director = ''
        folder.parent.mkdir(parents=True, exist_ok=True)
        # It has links.
        self._log.touch(mode=0o600)
        with self._log.open('wb') as log:
            self._process = subprocess.Popen(
                [sys.executable, '-m', 'crgame_ros.study.conduct.watched_launcher',
                 str(os.getpid()), str(game), '--out', str(folder), '--port', str(port),
                 '--no-report', '--start-paused', *more],
                stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
                env={**os.environ, 'ROS_DOMAIN_ID': str(self.domain_id)},
                # Ctrl-C goes to the study only, which ends its drive, then the graph.
                start_new_session=True)

    @property
    def pid(self) -> int:
        """Return the process id of the launcher."""
        return self._process.pid

    @property
    def has_ended(self) -> bool:
        """Return whether the launcher has ended, for any reason."""
        return self._process.poll() is not None

    @property
    def was_killed(self) -> bool:
        """Return whether a signal ended the launcher."""
        return (self._process.poll() or 0) < 0

    def poll(self) -> None:
        """Read the launcher's new output, which contains the cockpit's address."""
        with self._log.open('rb') as log:
            log.seek(self._read)
            content = self._rest + log.read()
            self._read = log.tell()
        *lines, self._rest = content.split(b'\n')
        for line in lines:
            text = line.decode('utf-8', 'replace')
            if _AT in text:
                self.cockpit = text.partition(_AT)[2].strip()
            elif _DIRECT in text:
                self.director = text.partition(_DIRECT)[2].strip()

    def last_words(self) -> str:
        """Return its last line about an error, or else its last line."""
        lines = [line for line in self._log.read_text('utf-8', 'replace').splitlines()
                 if line.strip()]
        errors = [line for line in lines if 'error' in line.lower() or ' died ' in line]
        return (errors or lines or ['it said nothing'])[-1].strip()[:300]

    def ask_to_end(self) -> None:
        """Request a clean shutdown."""
        if not self.has_ended:
            self._process.send_signal(signal.SIGINT)

    def end(self) -> None:
        """Shut it down, and wait until its recordings are finished."""
        self.ask_to_end()
        until_s = time.monotonic() + _END_S
        while not self.has_ended and time.monotonic() < until_s:
            time.sleep(0.05)
        if not self.has_ended:
            self._process.kill()
        self._process.wait()
