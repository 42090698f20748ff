# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Finishing the recordings of ended runs, while the graph stays for the next one."""

from collections.abc import Callable
import json
from pathlib import Path
import subprocess
import sys
import tempfile
import time
from typing import IO, TYPE_CHECKING

from crgame_ros.launcher.interruption import writing
from crgame_ros.launcher.run_report import write_run_report
from crgame_ros.recording.run_folder import FINISHED_MARK, is_closed, run_folders

if TYPE_CHECKING:  # It takes a second to import.
    from crgame_ros.analysis.runs.run import Run
    from crgame_ros.recording.finish import FinishedRecording

LOOK_S = 0.5


class Finisher:
    """
    The finisher of ended runs: the latest first, one at a time, while no run goes on.

    It would slow down a run in progress, so after a reset it waits for the next end.

    :param session: folder of the session, the same as that of its first run.
    :param reports: whether each run gets a report, once its other files are written.
    """

    def __init__(self, session: Path, say: Callable[[str], None], reports: bool = True) -> None:
        self._session = session
        self._say = say
        self._reports = reports
        self._finished: list[FinishedRecording] = []
        self._measured: dict[Path, Run | None] = {}
        # The process that finishes a run, and what it says: a file never is full, as a pipe is.
        self._process: tuple[subprocess.Popen[bytes], IO[str]] | None = None
        self._codes: dict[Path, int] = {}
        self._folder = session
        self._looked_s = 0.0

    def poll(self) -> None:
        """Report finished runs, and start the next one while no run goes on."""
        now_s = time.monotonic()
        if now_s - self._looked_s < LOOK_S:
            return
        self._looked_s = now_s
        if self._process is not None:
            self._collect(*self._process)
            return
        folders = run_folders(self._session)
        left = [folder for folder in folders if folder not in self._codes]
        if left and is_closed(folders[-1]):
            self._start(left[-1])

    def finish_all(self, asked_to_end: bool = False) -> int:
        """
        Finish the remaining runs after the end of the graph.

        :param asked_to_end: whether the user ended the graph: then a run need not have begun.
        :return: 0, or 1 if something could not be written, or nothing was recorded at all.
        """
        # It takes a second to import.
        from crgame_ros.recording.finish import EMPTY, finish_run, OK
        if self._process is not None:
            process, said = self._process
            with said:
                process.kill()
                process.wait()
            self._process = None
        folders = run_folders(self._session)
        if not folders:
            self._say(f'error: {self._session} has been removed during the run: nothing is left')
        for folder in folders:
            # One that a signal ended, perhaps for want of memory, has a negative code.
            if self._codes.get(folder, -1) < 0:
                self._codes[folder] = finish_run(
                    folder, self._say,
                    finished=self._finished.append if self._reports else lambda _: None)
            (folder / FINISHED_MARK).unlink(missing_ok=True)
        codes = set(self._codes.values())
        # A first game without a driver, before another one was chosen, is no failure.
        return 0 if codes <= {OK, EMPTY} and (OK in codes or asked_to_end) else 1

    def write_reports(self) -> None:
        """Write the reports of runs that `finish_all` finished; a second signal skips them."""
        if not self._finished:
            return
        try:
            with writing(self._say, 'still writing the report; once more leaves it out'):
                for each in self._finished:
                    self._measured[each.bag.parent] = write_run_report(each, self._say)
        except KeyboardInterrupt:
            self._say(f'no report; `crgame report {self._session}` writes it')

    def tell_outcomes(self) -> int:
        """
        Print one line about each run, as the last lines of a session.

        :return: `NO_PLANS` if some planner drove none of its plans, else 0.
        """
        from crgame_ros.analysis.outcome_line import tell_outcome
        code = 0
        for folder in run_folders(self._session):
            try:
                timing = json.loads((folder / 'timing.json').read_text(encoding='utf-8'))
            except (OSError, ValueError):
                # What kept it from being written has been told.
                continue
            run = self._measured.get(folder)
            code = tell_outcome(
                self._say, timing, None if run is None else run.usual_criticality,
                f'{folder.name}: ', () if run is None else run.usual_scores.vehicles) or code
        return code

    def _start(self, folder: Path) -> None:
        self._folder = folder
        # Ctrl-C is for the launcher, which then finishes all runs itself.
        said = tempfile.TemporaryFile('w+')
        self._process = subprocess.Popen(
            [sys.executable, '-m', 'crgame_ros.launcher.finish_process', str(folder),
             *([] if self._reports else ['--no-report'])],
            stdin=subprocess.DEVNULL, stdout=said, stderr=subprocess.STDOUT,
            start_new_session=True), said

    def _collect(self, process: subprocess.Popen[bytes], said: IO[str]) -> None:
        code = process.poll()
        if code is None:
            return
        with said:
            said.seek(0)
            for line in said:
                self._say(line.rstrip('\n'))
        self._codes[self._folder] = code
        self._process = None
