# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded human again, against another planner: what came of it, and what differs when."""

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

    :param planner: as it was asked for.
    :param log: the run on the scenario's grid.
    :param criticality: of it.
    :param human_differs_s: when a human first is elsewhere than in the recording; None: never [s]
    :param others_differ_s: when anybody but the driven vehicles first is: what reacts to the AV
        makes a world in which the human's inputs may no longer fit; None: never [s]
    :param accepted_ratio: by AV the share of its planner's answers that were accepted and no
        fallback; None where it is not known.
    :param contacts: the first contact of each pair, as entries of `timing.json`; None where they
        are not known.
    :param result: of an offline run; None of a live one.
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
        """Return what came of it, as JSON has it."""
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

    The same inputs over the same intervals, the same seeds of perception and traffic.

    :param planner: its name, for people.
    :param setup: of the recorded game, its human's driver the recording, with that planner.
    :param recorded: the run that was recorded.
    :param latency_steps: simulation steps between a request and its plan.
    :param traces: recorded states by vehicle (`recorded_states`), which the humans take instead of
        being driven; an AV that somebody had taken over follows its planner then.
    :param inputs: of the humans; None for those of the recording that the setup names.
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
