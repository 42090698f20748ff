# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Repeats a recorded human against another planner, and compares the result to the recording."""

from collections.abc import Callable, Mapping
from functools import cached_property, partial
from pathlib import Path
import time

from crgame_ros.analysis.runs.run import Run
from crgame_ros.driver.source import IdleDriver
from crgame_ros.errors import InputError
from crgame_ros.recording.progress import Progress
from crgame_ros.recording.recorded_game import recorded_inputs, RecordedInputs
from crgame_ros.recording.recorded_plans import RunReport
from crgame_ros.recording.run_folder import recording_in
from crgame_ros.recording.run_record import read_run_record, RunRecord
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.recording.timing_report import timing_report
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import Setup
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
SAME = 1e-9


class Alternative(Run):
    """
    A run of a recorded human against a planner.

    :ivar planner: its name, as given by the user.
    """

    def __init__(self, planner: str, recorded: RunTrajectories, *, bag: Path | None = None,
                 record: RunRecord | None = None, timing: RunReport | None = None,
                 result: OfflineResult | None = None) -> None:
        """
        Keep what is known, as `Run` does.

        :param recorded: the run that was recorded.
        """
        super().__init__(planner, bag=bag, record=record, timing=timing, result=result)
        self.planner, self._recorded = planner, recorded

    @classmethod
    def of_live(cls, planner: str, folder: Path, recorded: RunTrajectories) -> 'Alternative':
        """
        Read a live run.

        :param folder: of that run.
        :raises InputError: if its recording cannot be used.
        """
        bag = recording_in(folder)
        record = read_run_record(bag)
        return cls(planner, recorded, bag=bag, record=record,
                   timing=timing_report(bag, log=record.log))

    @cached_property
    def human_differs_s(self) -> float | None:
        """Return when a human's pose first differs from the recording [s]; None: never."""
        humans = len(self._recorded.game.humans)
        return self._differs_s(*(log.published_states[:, :humans, :3]
                                 for log in (self.log, self._recorded)))

    @cached_property
    def others_differ_s(self) -> float | None:
        """
        Return when the pose of an object that is not driven first differs [s]; None: never.

        Objects that react to the AV change the scene, and the human's inputs may no longer fit it.
        """
        return self._differs_s(self.log.object_poses, self._recorded.object_poses)

    def as_dict(self) -> dict[str, object]:
        """Return the result as a JSON-compatible dictionary."""
        return {
            'planner': self.planner, 'state_hash': self.state_hash,
            'human_differs_s': self.human_differs_s, 'others_differ_s': self.others_differ_s,
            'accepted_ratio': {av: found.accepted_share for av, found in self.answers.items()},
            'contacts': self.contacts,
            'criticality': self.usual_criticality.as_dict()}

    def _differs_s(self, found: FloatArray, expected: FloatArray) -> float | None:
        """Return the time at which poses (K, N, 3) of both runs begin to differ, None if never."""
        _, here, there = np.intersect1d(self.log.ks, self._recorded.ks, return_indices=True)
        apart = np.abs(found[here] - expected[there]) > SAME
        absent = np.isnan(found[here]) != np.isnan(expected[there])
        rows = np.flatnonzero((apart | absent).any(axis=(1, 2)))
        return float(self._recorded.times_s[there[rows[0]]]) if len(rows) else None


def drive_against(planner: str, setup: Setup, recorded: RunTrajectories, latency_steps: int = 0,
                  traces: Mapping[str, FloatArray] | None = None,
                  inputs: RecordedInputs | None = None,
                  say: Callable[[str], object] = lambda _: None) -> Alternative:
    """
    Drive a recorded human against the planner of a setup, for as long as was recorded.

    Inputs, their intervals, and the seeds of perception and traffic are those of the recording.

    :param planner: its name, for people.
    :param setup: the recorded game, with the recording as its human's driver and that planner.
    :param recorded: the run that was recorded.
    :param latency_steps: simulation steps between a request and its plan.
    :param traces: recorded states by vehicle (`recorded_states`), which the humans follow instead
        of being driven by inputs; an AV that a human had taken over then follows its planner.
    :param inputs: inputs of the humans; None for those of the recording that the setup names.
    :param say: called with each text about a planner that fails, and about progress.
    :raises InputError: if the recording's inputs cannot be used in the setup.
    """
    drive = partial(run_offline, setup, latency_steps=latency_steps, clock_s=time.perf_counter,
                    say=say, progress=Progress(say, f'driving against {planner}'))
    result = _drive_inputs(drive, setup, inputs) if traces is None \
        else _drive_trajectory(drive, setup, traces)
    return Alternative(planner, recorded, result=result)


def _drive_inputs(drive: Callable[..., OfflineResult], setup: Setup,
                  inputs: RecordedInputs | None) -> OfflineResult:
    drivers, intervals_s = inputs or recorded_inputs(setup)
    if intervals_s is None:
        raise InputError('no vehicle in it is driven by a recording', 'driver', 'give replay:BAG')
    return drive(duration_s=len(intervals_s) * setup.scheduler.dt_s, drivers=drivers,
                 intervals_s=intervals_s)


def _drive_trajectory(drive: Callable[..., OfflineResult], setup: Setup,
                      traces: Mapping[str, FloatArray]) -> OfflineResult:
    humans = {human.id: traces[human.id] for human in setup.humans}
    steps = min(map(len, humans.values())) - 1
    return drive(duration_s=steps * setup.scheduler.dt_s, traces=humans,
                 drivers={human: IdleDriver() for human in humans})
