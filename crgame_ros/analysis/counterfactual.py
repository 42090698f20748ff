# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Repeats a recorded human against another planner, and compares the result to the recording."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
import time
from typing import Any

from crgame_ros.analysis.criticality.criticality import Criticality
from crgame_ros.analysis.criticality.recorded import measure_log
from crgame_ros.driver.source import IdleDriver
from crgame_ros.errors import InputError
from crgame_ros.recording.recorded_inputs import recorded_inputs, RecordedInputs
from crgame_ros.recording.run_folder import recording_in
from crgame_ros.recording.run_trajectories import (
    read_trajectories,
    RunTrajectories,
    trajectories_of,
)
from crgame_ros.recording.timing_report import timing_report
from crgame_ros.simulation.contacts import contacts_of
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
    :param log: the run on the scenario's grid.
    :param criticality: measured in this run.
    :param human_differs_s: first time at which a human's pose differs from the recording; None:
        never [s]
    :param others_differ_s: first time at which the pose of an object that is not driven differs:
        objects that react to the AV change the scene, and the human's inputs may no longer fit
        it; None: never [s]
    :param accepted_ratio: by AV, the share of its planner's answers that were accepted and are
        no fallback; None where it is unknown.
    :param contacts: the first contact of each pair, as entries of `timing.json`; None where they
        are unknown.
    :param result: result of an offline run; None for a live one.
    """

    planner: str
    log: RunTrajectories
    criticality: Criticality
    human_differs_s: float | None
    others_differ_s: float | None
    accepted_ratio: Mapping[str, float | None]
    contacts: Sequence[Mapping[str, Any]] | None
    result: OfflineResult | None = None

    @property
    def state_hash(self) -> str | None:
        """Return the hash over all states of an offline run."""
        return None if self.result is None else self.result.state_hash

    def as_dict(self) -> dict[str, Any]:
        """Return the result as a JSON-compatible dictionary."""
        return {
            'planner': self.planner, 'state_hash': self.state_hash,
            'human_differs_s': self.human_differs_s, 'others_differ_s': self.others_differ_s,
            'accepted_ratio': self.accepted_ratio, 'contacts': self.contacts,
            'criticality': self.criticality.as_dict()}


def drive_against(planner: str, setup: Setup, recorded: RunTrajectories, latency_steps: int = 0,
                  traces: Mapping[str, FloatArray] | None = None,
                  inputs: RecordedInputs | None = None) -> Alternative:
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
    :raises InputError: if the recording's inputs cannot be used in the setup.
    """
    result = _drive_inputs(setup, latency_steps, inputs) if traces is None \
        else _drive_trajectory(setup, latency_steps, traces)
    return _compare(
        planner, trajectories_of(result), recorded,
        {av: record.accepted_ratio for av, record in result.planners.items()},
        [item.as_dict() for item in contacts_of(result)], result)


def driven_live(planner: str, folder: Path, recorded: RunTrajectories) -> Alternative:
    """
    Compare a live run of a recorded human against a planner, from the run's folder.

    :raises InputError: if its recording cannot be used.
    """
    bag = recording_in(folder)
    log = read_trajectories(bag)
    report = timing_report(bag, log=log)
    return _compare(planner, log, recorded, {
        av: None if told['accepted'] is None or not told['plans'] else
        max(0, told['accepted'] - (told['fallback'] or 0)) / told['plans']
        for av, told in report['planners'].items()}, report['contacts'])


def _drive_inputs(setup: Setup, latency_steps: int,
                  inputs: RecordedInputs | None) -> OfflineResult:
    drivers, intervals_s = inputs or recorded_inputs(setup)
    if intervals_s is None:
        raise InputError('no vehicle in it is driven by a recording', 'driver', 'give replay:BAG')
    return run_offline(setup, duration_s=len(intervals_s) * setup.scheduler.dt_s,
                       latency_steps=latency_steps, drivers=drivers, intervals_s=intervals_s,
                       clock_s=time.perf_counter)


def _drive_trajectory(setup: Setup, latency_steps: int,
                      traces: Mapping[str, FloatArray]) -> OfflineResult:
    humans = {human.id: traces[human.id] for human in setup.humans}
    steps = min(map(len, humans.values())) - 1
    return run_offline(setup, duration_s=steps * setup.scheduler.dt_s,
                       latency_steps=latency_steps, traces=humans,
                       drivers={human: IdleDriver() for human in humans},
                       clock_s=time.perf_counter)


def _compare(planner: str, log: RunTrajectories, recorded: RunTrajectories,
             accepted_ratio: Mapping[str, float | None],
             contacts: Sequence[Mapping[str, Any]] | None,
             result: OfflineResult | None = None) -> Alternative:
    humans = len(recorded.game.humans)
    return Alternative(
        planner, log, measure_log(log),
        _differs_s(log, recorded, log.published_states[:, :humans, :3],
                   recorded.published_states[:, :humans, :3]),
        _differs_s(log, recorded, log.object_poses, recorded.object_poses),
        accepted_ratio, contacts, result)


def _differs_s(log: RunTrajectories, recorded: RunTrajectories, found: NDArray[np.float64],
               expected: NDArray[np.float64]) -> float | None:
    """Return the time at which poses (K, N, 3) of two runs begin to differ, None if never."""
    ks, here, there = np.intersect1d(log.ks, recorded.ks, return_indices=True)
    apart = np.abs(found[here] - expected[there]) > SAME
    absent = np.isnan(found[here]) != np.isnan(expected[there])
    rows = np.flatnonzero((apart | absent).any(axis=(1, 2)))
    scheduler = recorded.game.scheduler
    return float((ks[rows[0]] - scheduler.k0) * scheduler.time_step_s) if len(rows) else None
