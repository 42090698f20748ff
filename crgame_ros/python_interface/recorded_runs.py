# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recorded runs, with the same interface as offline runs."""

from collections.abc import Mapping
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_setup
from crgame_ros.python_interface.finished_run import Run
from crgame_ros.python_interface.games import as_path, FileName
from crgame_ros.recording.conversion import convert_log, day_of, write_openscenario
from crgame_ros.recording.recorded_game import read_game_document
from crgame_ros.recording.recorded_states import recorded_states
from crgame_ros.recording.run_folder import recording_in, run_name
from crgame_ros.recording.run_formats import OPENSCENARIO
from crgame_ros.recording.run_trajectories import read_trajectories, RunTrajectories
from crgame_ros.simulation.setup import Setup
import numpy as np
from numpy.typing import NDArray


class RecordedRun(Run):
    """
    A run in a recording: ours or of `ros2 bag record`.

    :param name: displayed name.
    :param bag: the recording.
    :param log: the run in it.
    """

    def __init__(self, name: str, bag: Path, log: RunTrajectories) -> None:
        super().__init__(name, bag=bag, log=log)
        self._bag = bag

    def setup_against(self, planner: str) -> Setup:
        """
        Return the recorded game, driven by the recording, with another planner.

        :raises InputError: if the recording lacks its game, or holds a later run.
        """
        if read_game_document(self._bag).epoch != self.game.epoch:
            raise InputError('is not the last run of its recording', str(self._bag),
                             'only the last one can be driven again')
        return effective_setup(RunRequest(driver=f'replay:{self._bag}', planners=(planner,)))

    def recorded_inputs(self) -> None:
        """Return None: the setup names the recording."""

    def recorded_traces(self) -> Mapping[str, NDArray[np.float64]]:
        """Return the states (N, 8) of its vehicles at the simulation steps from 0 on."""
        return recorded_states(self._bag, self.game.epoch)

    def exported(self, out: Path) -> tuple[Path, tuple[str, ...]]:
        """Write the scenario; return its file, and the parts that it does not express."""
        if out.suffix == OPENSCENARIO:
            return write_openscenario(self.log, out, day=day_of(self._bag))
        found = convert_log(self.log, self._bag, out)
        return found.path, found.notices


def read_run(path: FileName, epoch: int | None = None) -> RecordedRun:
    """
    Read a run from its folder, or from a recording.

    :param epoch: which run, where a recording holds several; None for the last.
    :raises InputError: if it cannot be read.
    """
    place = as_path(path, 'run')
    bag = recording_in(place)
    return RecordedRun(run_name(place), bag, read_trajectories(bag, epoch))


def as_run(run: Run | FileName) -> Run:
    """
    Return a run unchanged, or read the run in a folder.

    :raises InputError: as `read_run`.
    """
    return run if isinstance(run, Run) else read_run(run)
