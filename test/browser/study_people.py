# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A study's session from outside: its program, its pages, and the processes to kill."""

from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
import json
import os
from pathlib import Path
import re
import signal
import ssl
import subprocess
import sys
import tempfile
import time
from typing import Any
import urllib.request

from browser_support import Browser, open_browser
from crgame_ros.study.session_journal import read_journal
from study_robot import StudyRobot
import websocket

# Targets for a kill: the participant's browser, and three processes of the program.
VICTIMS = ('page', 'simulation', 'launcher', 'study')
_LOOK_S = 0.2
# The certificate is made by the program itself.
_TRUSTING = ssl._create_unverified_context()


class _KeepRedirect(urllib.request.HTTPRedirectHandler):

    def redirect_request(self, *_: Any) -> None:
        """Follow no redirect, as the cookie is in the answer."""


class Experimenter:
    """
    The experimenter's connection.

    :param link: printed by the program; it admits one browser, once.
    :ivar cookie: admits the same person again, name=value.
    """

    def __init__(self, link: str) -> None:
        opener = urllib.request.build_opener(_KeepRedirect, urllib.request.HTTPSHandler(
            context=_TRUSTING))
        try:
            opener.open(link)
            self.cookie = ''
        except urllib.error.HTTPError as answer:
            self.cookie = answer.headers['Set-Cookie'].partition(';')[0]
        self._address = link.partition('/experimenter')[0]
        self._count = 0

    def order(self, kind: str, **fields: Any) -> None:
        """Send an order over its own connection, which reads nothing else."""
        self._count += 1
        with closing(websocket.create_connection(
                f'{self._address.replace("http", "ws", 1)}/ws/experimenter', cookie=self.cookie,
                origin=self._address, timeout=30,
                sslopt={'cert_reqs': ssl.CERT_NONE, 'check_hostname': False})) as connection:
            connection.send(json.dumps({'type': kind, 'id': self._count, **fields}))


class StudySession:
    """
    A participant in a browser that continues after every kill.

    :param file: study file.
    :param out: folder of its data.
    :param participant: id.
    :param port: of the pages.
    :param listen: address at which the pages are served over TLS; None for this machine alone.
    """

    def __init__(self, file: Path, out: Path, participant: str, port: int,
                 listen: str | None = None) -> None:
        self.command = [sys.executable, '-m', 'crgame_ros.cli', 'study', 'run', str(file),
                        '--participant', participant, '--out', str(out), '--port', str(port),
                        *(() if listen is None else ('--listen', listen))]
        self._is_elsewhere = listen is not None
        self.folder = out / 'participants' / participant
        self.answers: dict[str, Any] = {}
        # (name, run's clock as the page showed it when the message was sent) [s]
        self.marked: list[tuple[str, float]] = []
        self._browser: Browser | None = None
        self._end_browser: Any = None
        self._process: subprocess.Popen[str] | None = None
        self.is_over = False
        self._start()
        self._open()

    def _start(self) -> None:
        self._process = subprocess.Popen(self.command, stdout=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        self._process.stdout.readline()
        links = [re.findall(r'http\S+', self._process.stdout.readline()) for _ in range(2)]
        self.page, self.link = links[0][0], links[1][0]
        self.experimenter = Experimenter(self.link)

    def _open(self) -> None:
        self._profile = Path(tempfile.mkdtemp(prefix='crgame_study_'))
        self._end_browser = open_browser(self._profile, trusting=self._is_elsewhere)
        self._browser = self._end_browser.__enter__()
        self._browser.open(self.page)
        self._robot = StudyRobot(self._browser)

    @property
    def browser(self) -> Browser:
        """Return the participant's browser."""
        assert self._browser is not None
        return self._browser

    @property
    def entries(self) -> list[dict[str, Any]]:
        """Return the content of the journal."""
        return read_journal(self.folder)

    def act(self) -> str:
        """Answer the page's present request, and keep the program running."""
        assert self._process is not None
        if self._process.poll() is not None and not self.is_over:
            self._start()
        if self._robot.lost:
            self._close_browser()
            self._open()
        shown = self._robot.act()
        for told in self._robot.answers.values():
            self.answers.update(told)
        self.is_over = self.is_over or shown == 'over'
        return shown

    def time_s(self) -> float | None:
        """Return the run's clock as the page shows it [s]; None between drives."""
        return self._robot.time_s()

    def mark(self, name: str) -> None:
        """Set a marker while the page drives, and note the clock that the page shows."""
        time_s = self._robot.time_s()
        if time_s is not None:
            with suppress(OSError, websocket.WebSocketException):
                self.experimenter.order('mark', name=name)
                self.marked.append((name, time_s))

    def kill(self, victim: str) -> bool:
        """Kill one of `VICTIMS` (-9); return whether one existed."""
        if victim == 'page':
            _kill_with_profile(self._profile)
            return True
        assert self._process is not None
        if victim == 'study':
            self._process.kill()
            self._process.wait()
            return True
        logs = sorted((self.folder / 'runs').glob('*.log'), key=lambda path: path.stat().st_mtime)
        found = re.findall(r'sim_node: process (\d+)', logs[-1].read_text()) if logs else []
        with suppress(OSError, IndexError):
            pid = int(found[-1])
            # The launcher is the parent process.
            if victim == 'launcher':
                pid = int(Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[1])
            os.kill(pid, signal.SIGKILL)
            return True
        return False

    def run(self, patience_s: float, each: Any = lambda shown: None) -> None:
        """
        Go through the whole session.

        :param each: called each time with the shown page.
        """
        until_s = time.monotonic() + patience_s
        while not self.is_over:
            assert time.monotonic() < until_s, f'{self.folder}: {self.entries[-3:]}'
            each(self.act())
            time.sleep(_LOOK_S)
        assert self._process is not None
        self._process.wait(120.0)

    def close(self) -> None:
        """End the processes that still run."""
        self._close_browser()
        if self._process is not None and self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
            try:
                self._process.wait(120.0)
            except subprocess.TimeoutExpired:
                self._process.kill()

    def _close_browser(self) -> None:
        _kill_with_profile(self._profile)
        with suppress(Exception):
            self._end_browser.__exit__(None, None, None)


@contextmanager
def study_session(file: Path, out: Path, participant: str, port: int,
                  listen: str | None = None) -> Iterator[StudySession]:
    """Begin or resume a participant's session, and end it afterwards."""
    session = StudySession(file, out, participant, port, listen)
    try:
        yield session
    finally:
        session.close()


def _kill_with_profile(profile: Path) -> None:
    """Kill the browser that has its files in a folder, with all its processes."""
    mark = f'--user-data-dir={profile}'.encode()
    for entry in Path('/proc').iterdir():
        with suppress(OSError):
            if entry.name.isdecimal() and mark in (entry / 'cmdline').read_bytes():
                os.kill(int(entry.name), signal.SIGKILL)
