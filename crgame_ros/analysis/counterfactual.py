# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Repeats a recorded human against another planner, and compares the result to the recording."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
import time

from crgame_ros.analysis.criticality.criticality import Criticality
from crgame_ros.analysis.criticality.recorded import measure_log
from crgame_ros.driver.source import IdleDriver
from crgame_ros.errors import InputError
from crgame_ros.recording.progress import Progress
from crgame_ros.recording.recorded_game import recorded_inputs, RecordedInputs
from crgame_ros.recording.recorded_plans import plans_of_report, RunReport
from crgame_ros.recording.run_folder import recording_in
from crgame_ros.recording.run_record import read_run_record, run_record_of, RunRecord
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.recording.timing_report import offline_outcome, timing_report
from crgame_ros.simulation.contacts import ContactEntry
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import Setup
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
SAME = 1e-9


@dataclass(frozen=True)
class Alternative:
    """
    A run of a recorded human against a planner.

    :param planner: its name, as given by the user.
    :param record: the run: its motion on the scenario's grid, commands and events.
    :param outcome: of the run: content of `timing.json`, or result of `offline_outcome`.
    :param criticality: measured in this run.
    :param human_differs_s: first time at which a human's pose differs from the recording; None:
        never [s]
    :param others_differ_s: first time at which the pose of an object that is not driven differs:
        objects that react to the AV change the scene, and the human's inputs may no longer fit
        it; None: never [s]
    :param result: result of an offline run; None for a live one.
    """

    planner: str
    record: RunRecord
    outcome: RunReport
    criticality: Criticality
    human_differs_s: float | None
    others_differ_s: float | None
    result: OfflineResult | None = None

    @property
    def log(self) -> RunTrajectories:
        """Return the motion of all vehicles and objects, at the scenario's time steps."""
        return self.record.log

    @property
    def contacts(self) -> Sequence[ContactEntry] | None:
        """Return the first contact of each pair as in `timing.json`; None if unknown."""
        return self.outcome['contacts']

    @property
    def state_hash(self) -> str | None:
        """Return the hash over all states of an offline run."""
        return None if self.result is None else self.result.state_hash

    def as_dict(self) -> dict[str, object]:
        """Return the result as a JSON-compatible dictionary."""
        return {
            'planner': self.planner, 'state_hash': self.state_hash,
            'human_differs_s': self.human_differs_s, 'others_differ_s': self.others_differ_s,
            'accepted_ratio': {av: found.accepted_share
                               for av, found in plans_of_report(self.outcome).items()},
            'contacts': self.contacts,
            'criticality': self.criticality.as_dict()}


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
    return _compare(planner, run_record_of(result), offline_outcome(result), recorded, result)


def driven_live(planner: str, folder: Path, recorded: RunTrajectories) -> Alternative:
    """
    Compare a live run of a recorded human against a planner, from the run's folder.

    :raises InputError: if its recording cannot be used.
    """
    bag = recording_in(folder)
    record = read_run_record(bag)
    return _compare(planner, record, timing_report(bag, log=record.log), recorded)


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


def _compare(planner: str, record: RunRecord, outcome: RunReport,
             recorded: RunTrajectories, result: OfflineResult | None = None) -> Alternative:
    log, humans = record.log, len(recorded.game.humans)
    return Alternative(
        planner, record, outcome, measure_log(log),
        _differs_s(log, recorded, log.published_states[:, :humans, :3],
                   recorded.published_states[:, :humans, :3]),
        _differs_s(log, recorded, log.object_poses, recorded.object_poses), result)


def _differs_s(log: RunTrajectories, recorded: RunTrajectories, found: NDArray[np.float64],
               expected: NDArray[np.float64]) -> float | None:
    """Return the time at which poses (K, N, 3) of two runs begin to differ, None if never."""
    _, here, there = np.intersect1d(log.ks, recorded.ks, return_indices=True)
    apart = np.abs(found[here] - expected[there]) > SAME
    absent = np.isnan(found[here]) != np.isnan(expected[there])
    rows = np.flatnonzero((apart | absent).any(axis=(1, 2)))
    return float(recorded.times_s[there[rows[0]]]) if len(rows) else None
