# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded run for figures, read part by part on demand."""

from collections.abc import Callable
from functools import cached_property
from pathlib import Path
import re

from crgame_ros.analysis.criticality.recorded import measure_log
from crgame_ros.analysis.pictures.critical_moments import critical_moments, Moment, Touch
from crgame_ros.analysis.pictures.scene_frame import FrameScene, read_followed_plans
from crgame_ros.analysis.pictures.timing_figure import TimedRun
from crgame_ros.recording.epochs import read_epoch
from crgame_ros.recording.progress import Progress
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_cycles import read_cycles
from crgame_ros.recording.run_folder import recording_in
from crgame_ros.recording.run_record import read_run_record, RunRecord
from crgame_ros.recording.timing_report import timing_report


class FigureRun:
    """
    A recording to make figures of.

    :param path: folder of a run, or its recording.
    :param label: name in figures and tables; None for the folder's name.
    :param epoch: which run, where a recording holds several; None for the last.
    :param say: called with a line of progress, for people.
    """

    def __init__(self, path: Path, label: str | None, epoch: int | None,
                 say: Callable[[str], object]) -> None:
        self.path = path
        self.bag = recording_in(path)
        # A recording is in the folder of its run.
        self.folder = path if self.bag != path else path.parent
        resolved = path.resolve()
        self.label = label or (resolved.parent if re.fullmatch(r'bag(_part\d+)?', resolved.stem)
                               else resolved).name
        self._epoch = epoch
        self._say = say

    @property
    def name(self) -> str:
        """Return the name for files."""
        return re.sub(r'[^\w.-]+', '_', self.label).lstrip('.') or 'run'

    @cached_property
    def record(self) -> RunRecord:
        """
        Read the motion of all vehicles and objects.

        :raises InputError: if the recording lacks it.
        """
        return read_run_record(self.bag, self._epoch, self._progress('reading'))

    @cached_property
    def scene(self) -> FrameScene:
        """Read the content of frames."""
        log = self.record.log
        return FrameScene(log, read_followed_plans(self.bag, log,
                                                   self._progress('reading plans of')))

    @cached_property
    def moments(self) -> tuple[Moment, ...]:
        """Find the moments, the most critical one first."""
        log = self.record.log
        touches: tuple[Touch, ...] = ()
        # Without cycles, the steps of contacts are unknown; contacts at a tick are found anyway.
        if log.cycles is not None:
            report = timing_report(self.bag, log=log)
            touches = tuple(map(Touch.from_entry, report['contacts'] or ()))
        return critical_moments(
            self.record, measure_log(log, progress=self._progress('measuring')), touches)

    @cached_property
    def timed(self) -> TimedRun:
        """
        Read the cycles; they need no other recorded data.

        :raises InputError: if there are none.
        """
        with BagReader(self.bag, parts=True) as reader:
            game = read_epoch(reader, self._epoch).game
            return TimedRun(self.label, read_cycles(reader, game.epoch), game.scheduler.dt_s)

    def _progress(self, what: str) -> Progress:
        return Progress(self._say, f'{what} {self.path}')
